"""Quality of a mesh, and advice to improve it."""

import dataclasses

import numpy as np

from gravcomp.mesh.elements import constant_strain, edges, jacobians, reference_nodes, shape_gradients, stiffness_quadrature
from gravcomp.mesh.mesh import Mesh


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
    volume = np.linalg.det(jacobians(corners, shape_gradients(mesh.kind, points)))
    jacobian_ratio = float((volume.min(axis=1) / volume.max(axis=1)).min())
    begin, end = edges(mesh.kind).T
    lengths = np.linalg.norm(corners[:, begin] - corners[:, end], axis=2)
    aspect_ratio = float((lengths.max(axis=1) / lengths.min(axis=1)).max())
    advice = []
    if constant_strain(mesh.kind):
        advice.append("linear tetrahedra lock in bending: use hexahedra or quadratic tetrahedra")
    if jacobian_ratio < 0.1:
        advice.append(
            f"an element is badly distorted (Jacobian ratio {jacobian_ratio:.2g}): use smaller elements where the surface curves"
        )
    return MeshQuality(mesh.kind, len(mesh.nodes), len(mesh.elements), jacobian_ratio, aspect_ratio, tuple(advice))
