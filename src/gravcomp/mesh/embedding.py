"""Material points inside a mesh, as weights on nodes.

A point X of the body at rest lies in one element at the local coordinates xi with X = sum N_a(xi) X_a, and moves as x = sum
N_a(xi) x_a. Cables and observed sections are attached in this way, so they need no nodes of their own.
"""

import dataclasses

import numpy as np

from gravcomp.mesh.elements import distance_outside, is_hexahedron, shape_values
from gravcomp.mesh.local_coordinates import STARTS, local_coordinates
from gravcomp.mesh.mesh import Mesh, MeshError

# A smaller weight is rounding error of a point on a face, an edge or a node.
_NOTHING = 1e-9
# A point counts as found when it maps back within this part of the robot's length.
_MAPS_BACK = 1e-9
# How far outside its element, in local coordinates, a point may be attached by extrapolation: half an element.
_EXTRAPOLATED = 1.0
# Up to this much outside, in local coordinates, a point counts as inside.
_INSIDE = 1e-9


@dataclasses.dataclass(frozen=True)
class Embedding:
    """Points (p, 3) as weights on nodes: nodes (p, c) indices, weights (p, c).

    outside (p,): distance of a point outside its element in local coordinates, zero or less inside.
    """

    nodes: np.ndarray
    weights: np.ndarray
    outside: np.ndarray

    def renumbered(self, order: np.ndarray) -> "Embedding":
        """Return the same points on the mesh renumbered by `order`."""
        rank = np.empty(len(order), dtype=np.int64)
        rank[order] = np.arange(len(order))
        return dataclasses.replace(self, nodes=rank[self.nodes])

    def of(self, which: np.ndarray) -> "Embedding":
        """Return the points that are `which` (p,)."""
        return Embedding(self.nodes[which], self.weights[which], self.outside[which])


def embed(mesh: Mesh, points: np.ndarray) -> Embedding:
    """Attach each of the points (p, 3) to the mesh.

    A point inside is attached to the element that contains it. A point a little outside, because facets cut off a part of a
    round body, is attached to the nearest element by extrapolation. Every point maps back to its place within 1e-9 of the
    robot's length. Raises MeshError, with the distance, for a point farther outside.
    """
    points = np.asarray(points, dtype=float).reshape(-1, 3)
    found, attached = locate(mesh, points)
    if not attached.all():
        worst = np.flatnonzero(~attached)
        distances = [_distance(mesh, points[index]) for index in worst]
        index = int(np.argmax(distances))
        x, y, z = points[worst[index]] * 1e3
        raise MeshError(
            f"the point ({x:.4g}, {y:.4g}, {z:.4g}) mm lies {distances[index] * 1e3:.3g} mm outside the body; it must lie inside"
        )
    return found


def locate(mesh: Mesh, points: np.ndarray) -> tuple[Embedding, np.ndarray]:
    """Attach those of the points (p, 3) that lie in the mesh or at most half an element outside of it.

    Returns the embedding, and which points are attached (p,); the weights of the others are zero.
    """
    points = np.asarray(points, dtype=float).reshape(-1, 3)
    corners = mesh.nodes[mesh.elements]
    low, high = corners.min(axis=1), corners.max(axis=1)
    # A curved side bulges beyond its nodes, and a cable may lie on the surface.
    margin = 0.1 * (high - low).max(axis=1, keepdims=True)
    pair_point, pair_element = [], []
    for index, point in enumerate(points):
        near = np.flatnonzero(np.all((point >= low - margin) & (point <= high + margin), axis=1))
        pair_point.append(np.full(len(near), index))
        pair_element.append(near)
    points_of, elements_of = np.concatenate(pair_point), np.concatenate(pair_element)
    local = np.zeros((len(points_of), 3))
    distance, found = np.full(len(points_of), np.inf), np.zeros(len(points_of), dtype=bool)
    tolerance = _MAPS_BACK * mesh.length
    for attempt in range(STARTS):
        # A point that is inside an element needs no further search in others.
        settled = np.zeros(len(points), dtype=bool)
        settled[points_of[distance <= _INSIDE]] = True
        again = np.flatnonzero(~found & ~settled[points_of])
        if not len(again):
            break
        at, _, reached = local_coordinates(mesh.kind, corners[elements_of[again]], points[points_of[again]], tolerance, attempt)
        local[again[reached]], found[again[reached]] = at[reached], True
        distance[again[reached]] = distance_outside(mesh.kind, at[reached])
    best = np.full(len(points), -1)
    for pair in np.argsort(-distance, kind="stable"):  # the last one written is the deepest inside
        if distance[pair] <= _EXTRAPOLATED:
            best[points_of[pair]] = pair
    attached = best >= 0
    nodes = np.zeros((len(points), mesh.elements.shape[1]), dtype=mesh.elements.dtype)
    weights, outside = np.zeros(nodes.shape), np.full(len(points), np.inf)
    chosen = best[attached]
    nodes[attached] = mesh.elements[elements_of[chosen]]
    weights[attached] = shape_values(mesh.kind, local[chosen])
    outside[attached] = distance[chosen]
    weights[np.abs(weights) < _NOTHING] = 0.0
    return Embedding(nodes, weights, outside), attached


def _distance(mesh: Mesh, point: np.ndarray) -> float:
    """Distance (m) of a point from the nearest of the elements' nodes and of a lattice of points in the nearest elements."""
    squares = ((mesh.nodes - point) ** 2).sum(axis=1)
    nearest = np.argsort(squares)[:20]
    near = mesh.elements[np.isin(mesh.elements, nearest).any(axis=1)]
    parts = np.linspace(0.0, 1.0, 9)
    if is_hexahedron(mesh.kind):
        parts = 2.0 * parts - 1.0
    lattice = np.stack(np.meshgrid(parts, parts, parts, indexing="ij"), axis=-1).reshape(-1, 3)
    lattice = lattice[distance_outside(mesh.kind, lattice) < 1e-9]
    images = shape_values(mesh.kind, lattice) @ mesh.nodes[near]
    return float(np.sqrt(min(((images - point) ** 2).sum(axis=2).min(), squares.min())))
