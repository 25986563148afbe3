"""Newton's tangent where only the walls keep the robot from buckling.

A rod that an end load presses against a wall has, beyond the load at which it buckles freely, a stiffness A that is not
positive definite: it has no factor of Cholesky. Springs of the stiffness k on the middles C u of the pressed sections make

    A' = A + k C^T C

positive definite, as the walls do. What the springs add is taken out of each solution (Woodbury 1950), so that they change no
result:

    A^-1 = A'^-1 + Z (1/k - C Z)^-1 Z^T,      Z = A'^-1 C^T.

A has as many negative eigenvalues as 1/k - C Z (Sylvester's law of inertia, both Schur complements of [[A', C^T], [C, 1/k]]).
Whether the robot stays there is decided by `contact.stability`.
"""

from collections.abc import Sequence

import numpy as np

from gravcomp.full_model.model import MeshedModel
from gravcomp.full_model.turning_loads import add_part
from gravcomp.mechanics.block_matrix import BlockCholesky, BlockMatrix


class SupportedFactor:
    """Solves with A, of which A' has a factor. Attribute: negative, the number of negative eigenvalues of A."""

    def __init__(self, factor: BlockCholesky, rows: np.ndarray, stiffness: float):
        """rows C (k, 3 n_free); stiffness k in N/m."""
        self._factor, self._rows = factor, rows
        self._answer = factor.solve(np.ascontiguousarray(rows.T))
        self._inner = np.eye(len(rows)) / stiffness - rows @ self._answer
        self.negative = int((np.linalg.eigvalsh(0.5 * (self._inner + self._inner.T)) < 0.0).sum())

    def solve(self, right: np.ndarray) -> np.ndarray:
        """Return the solution (3 n_free,) or (3 n_free, k) for the right-hand sides."""
        held = self.held(right)
        result: np.ndarray = held + self._answer @ np.linalg.solve(self._inner, self._rows @ held)
        return result

    def held(self, right: np.ndarray) -> np.ndarray:
        """Return the solution as `solve`, with the springs."""
        return self._factor.solve(right)


def add_springs(matrix: BlockMatrix, model: MeshedModel, sections: Sequence[np.ndarray], stiffness: float) -> np.ndarray:
    """Add springs on the middles of sections, rows (n,) each, to the stiffness; return C (k, 3 n_free) of those that fit."""
    rows = []
    for middle in sections:
        if add_part(matrix, model, middle[None], -stiffness * np.eye(3)):
            rows.append(np.kron(middle[None, : model.n_free], np.eye(3)))
    return np.concatenate(rows) if rows else np.zeros((0, 3 * model.n_free))
