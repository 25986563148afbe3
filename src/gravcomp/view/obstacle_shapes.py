"""The obstacles of a scene as surfaces to draw, each in the frame that it belongs to.

Surfaces face into the free space. They are fine enough for the picture of the camera at the tip, which bends straight edges.
"""

import dataclasses
import math

import numpy as np

from gravcomp.scene.distance import BOX, PLANE, SPHERE, TUBE, SceneArrays
from gravcomp.scene.scene import Scene
from gravcomp.view.plane_patch import patch_side, plane_foot, plane_patch
from gravcomp.view.skin import quads

_AROUND, _ALONG = 40, 14  # vertices around a tube, and rings on each of its pieces


@dataclasses.dataclass(frozen=True)
class ObstacleShape:
    """A surface: vertices (v, 3) m in soft_base, or in the world, faces (f, 3)."""

    name: str
    vertices: np.ndarray
    faces: np.ndarray
    in_world: bool
    forbidden: bool


def obstacle_shapes(scene: Scene, length: float, forbidden: bool = False) -> list[ObstacleShape]:
    """Return the obstacles of a scene around a robot of `length` (m); forbidden: they are zones."""
    own = scene.turned(np.eye(3))
    shapes = []
    for number, name in enumerate(scene.names):
        rows = np.flatnonzero(own.obstacle == number)
        box_inside = len(rows) > 1  # six planes
        if box_inside:
            parts = [_hollow(own, rows)]
        else:
            # The middle of the straight robot; that of the horizontal one in the world.
            middle = np.array([length / 2, 0.0, 0.0] if scene.in_world[rows[0]] else [0.0, 0.0, length / 2])
            parts = [_surface(own, int(row), length, middle) for row in rows]
        for vertices, faces in parts:
            shapes.append(ObstacleShape(name, vertices, faces, bool(scene.in_world[rows[0]]), forbidden))
    return shapes


def _surface(own: SceneArrays, row: int, length: float, middle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    kind, rotation, origin = own.kind[row], own.rotation[row], own.origin[row]
    if kind == PLANE:
        vertices, faces = plane_patch(patch_side(length))
        return vertices @ rotation.T + plane_foot(rotation[:, 2], origin, middle), faces
    if kind == SPHERE:
        vertices, faces = _ball(own.size[row, 0])
    elif kind == BOX:
        vertices, faces = _cuboid(own.size[row])
    elif kind == TUBE:
        vertices, faces = _tube(own, row)
    else:
        vertices, faces = _triangles(own, int(own.first[row]))
    if own.sign[row] < 0.0:
        faces = faces[:, ::-1]
    return vertices @ rotation.T + origin, faces


def _ball(radius: float) -> tuple[np.ndarray, np.ndarray]:
    angle = np.linspace(0.0, 2 * math.pi, _AROUND, endpoint=False)
    height = np.linspace(1e-3, math.pi - 1e-3, _AROUND // 2)
    ring = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    vertices = np.sin(height)[:, None, None] * ring - np.cos(height)[:, None, None] * np.array([0.0, 0.0, 1.0])
    return radius * vertices.reshape(-1, 3), quads(len(height), _AROUND)


def _cuboid(half: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    vertices, faces, count = [], [], 0
    patch, cells = plane_patch(2.0)
    for axis in range(3):
        for sign in (1.0, -1.0):
            turn = np.roll(np.eye(3), axis, axis=1) * np.array([1.0, 1.0, sign])
            side = (patch + np.array([0.0, 0.0, 1.0])) @ turn.T
            # A turn that mirrors the patch turns its faces over.
            faces.append((cells if np.linalg.det(turn) > 0.0 else cells[:, ::-1]) + count)
            vertices.append(side * half)
            count += len(patch)
    return np.concatenate(vertices), np.concatenate(faces)


def _hollow(own: SceneArrays, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The inside of a cuboid from its six planes, pairs of opposite ones."""
    axes, half, centre = [], [], np.zeros(3)
    for one, other in (rows[0:2], rows[2:4], rows[4:6]):
        out = own.origin[one] - own.origin[other]
        size = float(np.linalg.norm(out))
        axes.append(out / size)
        half.append(size / 2)
        middle = (own.origin[one] + own.origin[other]) / 2
        centre = centre + (middle @ axes[-1]) * axes[-1]
    vertices, faces = _cuboid(np.array(half))
    turn = np.column_stack(axes)
    return vertices @ turn.T + centre, faces[:, ::-1] if np.linalg.det(turn) > 0.0 else faces


def _tube(own: SceneArrays, row: int) -> tuple[np.ndarray, np.ndarray]:
    """A tube along its curve, facing outward; a closed end by half a ball."""
    pieces = own.curve[own.first[row] : own.last[row]]
    share = np.linspace(0.0, 1.0, _ALONG, endpoint=False)
    powers, slopes = share[:, None] ** np.arange(3, -1, -1), np.arange(3, 0, -1) * share[:, None] ** np.arange(2, -1, -1)
    value = np.einsum("sp,cpi->csi", powers, pieces).reshape(-1, 4)
    slope = np.einsum("sp,cpi->csi", slopes, pieces[:, :3, :3]).reshape(-1, 3)
    value = np.concatenate([value, pieces[-1].sum(axis=0)[None]])
    slope = np.concatenate([slope, (np.array([3.0, 2.0, 1.0]) @ pieces[-1][:3, :3])[None]])
    along = slope / np.linalg.norm(slope, axis=1, keepdims=True)
    if own.closed[row]:
        turn = np.linspace(0.0, math.pi / 2 - 1e-3, _ALONG)[1:]
        end, radius = value[-1, :3], value[-1, 3]
        cap = np.column_stack([end + radius * np.sin(turn)[:, None] * along[-1], radius * np.cos(turn)])
        value, along = np.concatenate([value, cap]), np.concatenate([along, np.repeat(along[-1:], len(cap), axis=0)])
    across = _across(along)
    angle = np.linspace(0.0, 2 * math.pi, _AROUND, endpoint=False)
    other = np.cross(along, across)
    ring = np.cos(angle)[None, :, None] * across[:, None] + np.sin(angle)[None, :, None] * other[:, None]
    vertices = value[:, None, :3] + value[:, None, 3:] * ring
    return vertices.reshape(-1, 3), quads(len(value), _AROUND)


def _across(along: np.ndarray) -> np.ndarray:
    """Unit vectors (k, 3) across the tangents (k, 3), which turn as little as possible from one to the next."""
    first = np.cross(along[0], np.eye(3)[np.argmin(np.abs(along[0]))])
    vectors = [first / np.linalg.norm(first)]
    for tangent in along[1:]:
        carried = vectors[-1] - (vectors[-1] @ tangent) * tangent
        vectors.append(carried / np.linalg.norm(carried))
    return np.array(vectors)


def _triangles(own: SceneArrays, root: int) -> tuple[np.ndarray, np.ndarray]:
    """The triangles of a surface from a file, which face outward, with the vertices that they share."""
    tree, boxes, corners = own.surface, [root], []
    while boxes:
        box = boxes.pop()
        child = tree.child[box]
        if child >= 0:
            boxes += [child, child + 1]
        else:
            corners.append(tree.corners[-1 - child : -1 - child + tree.leaf[box]])
    vertices, faces = np.unique(np.concatenate(corners).reshape(-1, 3), axis=0, return_inverse=True)
    return vertices, faces.reshape(-1, 3)
