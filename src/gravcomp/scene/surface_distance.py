"""Signed distance to closed triangle surfaces: a tree of bounding boxes and pseudonormals; compiled.

The nearest point of the surface lies in a triangle, on an edge or at a vertex; the sign follows from the normal there: that of
the triangle, the mean of both triangles, or the mean over the vertex weighted by the angles (J. Baerentzen, H. Aanaes, IEEE TVCG
2005). The distance is exact for the triangles.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

_LEAF = 4  # triangles in a leaf
_DEEP = 64  # a tree of halves of 2^60 triangles is not deeper
_TOUCHING = 1e-9  # m: nearer than this the direction to the surface is rounding error


class SurfaceArrays(NamedTuple):
    """Trees of all surfaces. Positions are in the obstacles' own frames, in m.

    low and high (b, 3): bounding boxes; child (b,): the first of two successive children, or -1 - first triangle of a leaf; leaf
    (b,): its number of triangles; corners (f, 3, 3): triangles in the order of the leaves; normals (f, 7, 3): of the triangle,
    of its edges 01, 12, 20, of its corners.
    """

    low: np.ndarray
    high: np.ndarray
    child: np.ndarray
    leaf: np.ndarray
    corners: np.ndarray
    normals: np.ndarray

    @staticmethod
    def none() -> "SurfaceArrays":
        """Return arrays without a surface."""
        whole = np.zeros(0, dtype=np.int64)
        return SurfaceArrays(np.zeros((0, 3)), np.zeros((0, 3)), whole, whole, np.zeros((0, 3, 3)), np.zeros((0, 7, 3)))

    def joined(self, other: "SurfaceArrays") -> "SurfaceArrays":
        """Return these trees followed by others, whose roots move by the number of boxes here."""
        child = np.where(other.child >= 0, other.child + len(self.child), other.child - len(self.corners))
        parts = zip(self, other._replace(child=child))
        return SurfaceArrays(*(np.concatenate(pair) for pair in parts))


def surface_arrays(nodes: np.ndarray, faces: np.ndarray, chosen: np.ndarray | None = None) -> SurfaceArrays:
    """Return the tree of a closed surface of nodes (n, 3) and triangles (f, 3) that face outward; its root is box 0.

    chosen (c,): indices of the triangles that the tree has, None: all. Their normals are those in the whole surface.
    """
    corners = nodes[faces]
    normals = _pseudonormals(nodes, faces, corners)
    if chosen is not None:
        corners, normals = corners[chosen], normals[chosen]
    centre = corners.mean(axis=1)
    low, high, child, leaf, order = [], [], [], [], list[np.ndarray]()
    boxes = [np.arange(len(corners))]
    index = 0
    while index < len(boxes):
        chosen = boxes[index]
        low.append(corners[chosen].min(axis=(0, 1)))
        high.append(corners[chosen].max(axis=(0, 1)))
        if len(chosen) <= _LEAF:
            child.append(-1 - sum(len(done) for done in order))
            leaf.append(len(chosen))
            order.append(chosen)
        else:
            axis = int(np.argmax(np.ptp(centre[chosen], axis=0)))
            half = len(chosen) // 2
            split = chosen[np.argpartition(centre[chosen, axis], half)]
            child.append(len(boxes))
            leaf.append(0)
            boxes += [split[:half], split[half:]]
        index += 1
    placed = np.concatenate(order)
    return SurfaceArrays(
        np.array(low), np.array(high), np.array(child), np.array(leaf), np.ascontiguousarray(corners[placed]), normals[placed]
    )


def _pseudonormals(nodes: np.ndarray, faces: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Normals (f, 7, 3) of triangles, their edges and corners."""
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    unit = across / np.linalg.norm(across, axis=1, keepdims=True)
    normals = np.empty((len(faces), 7, 3))
    normals[:, 0] = unit
    edges = faces[:, [(0, 1), (1, 2), (2, 0)]].reshape(-1, 2)
    _, number = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True)
    total = np.zeros((number.max() + 1, 3))
    np.add.at(total, number, np.repeat(unit, 3, axis=0))
    normals[:, 1:4] = total[number].reshape(-1, 3, 3)
    at_corner = np.zeros_like(nodes)
    for i in range(3):
        one, other = corners[:, (i + 1) % 3] - corners[:, i], corners[:, (i + 2) % 3] - corners[:, i]
        cosine = (one * other).sum(axis=1) / np.linalg.norm(one, axis=1) / np.linalg.norm(other, axis=1)
        np.add.at(at_corner, faces[:, i], np.arccos(np.clip(cosine, -1.0, 1.0))[:, None] * unit)
    normals[:, 4:] = at_corner[faces]
    return normals / np.linalg.norm(normals, axis=2, keepdims=True)


@njit(cache=True)
def surface_gap(surface: SurfaceArrays, root: int, point: np.ndarray, normal: np.ndarray) -> float:
    """Return the distance in m of a point (3,) to the surface of the tree at `root`, negative inside, and write its gradient."""
    stack = np.empty(_DEEP, dtype=np.int64)
    stack[0], depth = root, 1
    best, triangle, region = np.inf, -1, 0
    foot, found = np.empty(3), np.zeros(3)
    while depth > 0:
        depth -= 1
        box = stack[depth]
        if _to_box(surface, box, point) >= best:
            continue
        child = surface.child[box]
        if child >= 0:
            one, other = _to_box(surface, child, point), _to_box(surface, child + 1, point)
            near, far = (child, child + 1) if one < other else (child + 1, child)
            stack[depth], stack[depth + 1] = far, near
            depth += 2
            continue
        for f in range(-1 - child, -1 - child + surface.leaf[box]):
            where = _foot(point, surface.corners[f], foot)
            square = (point[0] - foot[0]) ** 2 + (point[1] - foot[1]) ** 2 + (point[2] - foot[2]) ** 2
            if square < best:
                best, triangle, region = square, f, where
                found[:] = foot
    distance = np.sqrt(best)
    out = surface.normals[triangle, region]
    sign = (
        1.0 if (point[0] - found[0]) * out[0] + (point[1] - found[1]) * out[1] + (point[2] - found[2]) * out[2] >= 0.0 else -1.0
    )
    if region == 0 or distance < _TOUCHING:
        normal[:] = out
    else:
        for i in range(3):
            normal[i] = sign * (point[i] - found[i]) / distance
    return sign * distance


@njit(cache=True)
def _to_box(surface: SurfaceArrays, box: int, point: np.ndarray) -> float:
    """Return the square of the distance from a point to a box, 0 inside."""
    square = 0.0
    for i in range(3):
        beyond = max(surface.low[box, i] - point[i], point[i] - surface.high[box, i], 0.0)
        square += beyond * beyond
    return square


@njit(cache=True)
def _foot(point: np.ndarray, corners: np.ndarray, foot: np.ndarray) -> int:
    """Write the point of a triangle (3, 3) nearest to a point, and return where it is: 0 inside, 1 to 3 edges, 4 to 6 corners.

    C. Ericson, Real-Time Collision Detection, 2005, section 5.1.5.
    """
    a, b, c = corners[0], corners[1], corners[2]
    d1 = d2 = d3 = d4 = d5 = d6 = 0.0
    for i in range(3):
        ab, ac = b[i] - a[i], c[i] - a[i]
        d1 += ab * (point[i] - a[i])
        d2 += ac * (point[i] - a[i])
        d3 += ab * (point[i] - b[i])
        d4 += ac * (point[i] - b[i])
        d5 += ab * (point[i] - c[i])
        d6 += ac * (point[i] - c[i])
    if d1 <= 0.0 and d2 <= 0.0:
        foot[:] = a
        return 4
    if d3 >= 0.0 and d4 <= d3:
        foot[:] = b
        return 5
    vc = d1 * d4 - d3 * d2
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        foot[:] = a + d1 / (d1 - d3) * (b - a)
        return 1
    if d6 >= 0.0 and d5 <= d6:
        foot[:] = c
        return 6
    vb = d5 * d2 - d1 * d6
    if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        foot[:] = a + d2 / (d2 - d6) * (c - a)
        return 3
    va = d3 * d6 - d5 * d4
    if va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        foot[:] = b + (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b)
        return 2
    whole = va + vb + vc
    foot[:] = a + vb / whole * (b - a) + vc / whole * (c - a)
    return 0
