"""Small bodies for tests, in mm, along z from the origin: a tapered tube of tetrahedra and its surface, and bodies of boxes."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from gravcomp.mesh_files.repair_volume import boundary_triangles

LENGTH = 80.0
TAPERED_TUBE = Path(__file__).with_name("tapered_tube.vtk")
"""Quadratic tetrahedra, twelve layers that grow from 3 to 12 mm: the tube of the shipped `mesh_body`, more coarsely."""


def cone() -> tuple[np.ndarray, np.ndarray]:
    """Nodes (n, 3) and linear tetrahedra (k, 4) of a tube, 9 mm wide at the base, 6 mm at the tip, 80 mm long, lumen 3 mm."""
    import meshio

    content = meshio.read(TAPERED_TUBE)
    used, corners = np.unique(content.cells_dict["tetra10"][:, :4], return_inverse=True)
    return np.array(content.points[used], dtype=float), corners.reshape(-1, 4)


def surface() -> tuple[np.ndarray, np.ndarray]:
    """Nodes (n, 3) and triangles (f, 3), facing outward, of the same tube."""
    nodes, tetrahedra = cone()
    used, triangles = np.unique(boundary_triangles(tetrahedra), return_inverse=True)
    return nodes[used], triangles.reshape(-1, 3)


def bent(nodes: np.ndarray, angle: float) -> np.ndarray:
    """The nodes (n, 3) with the axis of the tube bent into an arc of `angle` (rad) towards x."""
    radius = LENGTH / angle
    turn = nodes[:, 2] / radius
    x = radius - (radius - nodes[:, 0]) * np.cos(turn)
    return np.column_stack([x, nodes[:, 1], (radius - nodes[:, 0]) * np.sin(turn)])


def rounded(nodes: np.ndarray) -> np.ndarray:
    """The nodes (n, 3) with the tip of the tube rounded."""
    over = np.clip(nodes[:, 2] / LENGTH - 0.9, 0.0, None) * 10.0
    return nodes - np.outer(over * np.hypot(nodes[:, 0], nodes[:, 1]), [0.0, 0.0, 1.0])


def boxes(x: Sequence[float], y: Sequence[float], z: Sequence[float], filled: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Nodes (n, 3) and triangles (f, 3), facing outward, around the cells between planes at x, y and z that are filled."""
    numbers = np.arange(len(x) * len(y) * len(z)).reshape(len(x), len(y), len(z))
    around = np.pad(filled, 1)
    triangles = []
    for axis in range(3):
        for side in (-1, 1):
            outer = np.argwhere(filled & ~np.roll(around, -side, axis=axis)[1:-1, 1:-1, 1:-1])
            outer[:, axis] += side > 0
            across, up = (np.eye(3, dtype=int)[(axis + turn) % 3] for turn in (1, 2))
            a, b, c, d = (numbers[tuple((outer + step).T)] for step in (0 * up, across, across + up, up)[::side])
            triangles += [np.column_stack([a, b, c]), np.column_stack([a, c, d])]
    used, faces = np.unique(np.vstack(triangles), return_inverse=True)
    return np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1).reshape(-1, 3)[used], faces.reshape(-1, 3)
