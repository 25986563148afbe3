"""Displacement gradients of modes at quadrature points."""

import numpy as np

from gravcomp.mechanics.total_lagrangian import SolidElements


def on_nodes(elements: SolidElements, columns: np.ndarray) -> np.ndarray:
    """Return fields (n, 3, k) of the unknowns (3 n_free, k), zero at the clamp."""
    fields = np.zeros((len(elements.mesh.nodes), 3, columns.shape[1]))
    fields[: elements.n_free] = columns.reshape(elements.n_free, 3, -1)
    return fields


def mode_gradients(elements: SolidElements, basis: np.ndarray, element: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Return d phi_i / d X_j (p, 3, 3, r) of a basis (3 n_free, r) at points: element (p,), number in the element (p,)."""
    local = on_nodes(elements, basis)[elements.mesh.elements[element]]
    return np.einsum("pjc,pcia->pija", elements.gradients[element, point], local, optimize=True)
