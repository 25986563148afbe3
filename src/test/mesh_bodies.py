"""Small bodies for tests, in mm, along z from the origin: a tapered tube of tetrahedra and its surface."""

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
