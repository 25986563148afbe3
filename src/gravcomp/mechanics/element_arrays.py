"""Constant arrays of a mesh's elements: gradients and weights at the quadrature points, positions in the stiffness matrix."""

import numpy as np

from gravcomp.mechanics.block_matrix import BlockPattern
from gravcomp.mesh import Mesh, MeshError
from gravcomp.mesh.elements import jacobians, shape_gradients


def reference_geometry(mesh: Mesh, points: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return gradients (k, p, 3, c) of the shape functions by rest coordinates, and weights (k, p) in m^3, for a quadrature rule.

    Raises MeshError for inverted or flat elements.
    """
    local = shape_gradients(mesh.kind, points)
    jacobian = jacobians(mesh.nodes[mesh.elements], local)
    volume = np.linalg.det(jacobian)
    if (volume <= 0).any():
        bad = np.flatnonzero((volume <= 0).any(axis=1))
        raise MeshError(f"{len(bad)} of {len(volume)} elements are inverted or flat (the first is number {bad[0]})")
    outward = np.linalg.inv(jacobian).swapaxes(2, 3)  # (k, p, i, j): derivative of the local coordinate j by X_i
    gradients = np.empty((*outward.shape[:3], local.shape[1]))
    for p, at_point in enumerate(local):  # one product of matrices for all elements
        gradients[:, p] = (outward[:, p].reshape(-1, 3) @ at_point.T).reshape(len(outward), 3, -1)
    return gradients, volume * weights


def scatter_positions(elements: np.ndarray, pattern: BlockPattern) -> np.ndarray:
    """Return (k, d (d + 1) / 2): the position of each entry of the lower triangle of each element's matrix, -1 if clamped.

    elements (k, c): nodes; d = 3 c. Unknowns of an element are ordered component by component, x of all nodes first.
    """
    unknown = np.concatenate([3 * elements + i for i in range(3)], axis=1)
    row, column = np.tril_indices(unknown.shape[1])
    rows, columns = unknown[:, row], unknown[:, column]
    free = (rows < pattern.n) & (columns < pattern.n)
    position = np.full(rows.shape, -1, dtype=np.int64)
    position[free] = pattern.position(rows[free], columns[free])
    return position.astype(np.int32)
