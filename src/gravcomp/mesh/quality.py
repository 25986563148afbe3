"""Quality of a mesh, and advice to improve it."""

import dataclasses

import numpy as np

from gravcomp.mesh.elements import reference_nodes, shape_gradients, stiffness_quadrature
from gravcomp.mesh.mesh import Mesh
from gravcomp.mesh.quadratic import TET_EDGES


@dataclasses.dataclass(frozen=True)
class MeshQuality:
    """Quality of a mesh.

    kind; nodes and elements: numbers; jacobian_ratio: smallest over largest det dX/dxi of the worst element (1: undistorted, 0
    or less: inverted somewhere); aspect_ratio: longest over shortest edge of the worst element; advice: sentences.
    """

    kind: str
    nodes: int
    elements: int
    jacobian_ratio: float
    aspect_ratio: float
    advice: tuple[str, ...]


def mesh_quality(mesh: Mesh) -> MeshQuality:
    """Return the quality of a mesh."""
    corners = mesh.nodes[mesh.elements]
    # Evaluated at the quadrature points and at the nodes, where the Jacobian of a tetrahedron has its extremes.
    points = np.vstack([stiffness_quadrature(mesh.kind).points, reference_nodes(mesh.kind)])
    volume = np.linalg.det(np.einsum("kai,paj->kpij", corners, shape_gradients(mesh.kind, points)))
    jacobian_ratio = float((volume.min(axis=1) / volume.max(axis=1)).min())
    edges = np.linalg.norm(corners[:, _edges(mesh.kind)[:, 0]] - corners[:, _edges(mesh.kind)[:, 1]], axis=2)
    aspect_ratio = float((edges.max(axis=1) / edges.min(axis=1)).max())
    advice = []
    if mesh.kind == "tet4":
        advice.append("linear tetrahedra lock in bending: use hexahedra or quadratic tetrahedra")
    if jacobian_ratio < 0.1:
        advice.append(
            f"an element is badly distorted (Jacobian ratio {jacobian_ratio:.2g}): use smaller elements where the surface curves"
        )
    if aspect_ratio > 20.0:
        advice.append(f"an element is {aspect_ratio:.0f} times as long as it is thin: use more elements along the robot")
    return MeshQuality(mesh.kind, len(mesh.nodes), len(mesh.elements), jacobian_ratio, aspect_ratio, tuple(advice))


def _edges(kind: str) -> np.ndarray:
    """Return the edges (e, 2) of an element as pairs of local node numbers."""
    if kind == "hex20":
        ends = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
        return np.array(ends)
    return TET_EDGES
