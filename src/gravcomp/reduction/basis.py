"""The reduced basis: proper orthogonal decomposition (POD) of trained shapes in the energy of the straight robot.

Of all bases with r columns, the POD basis has the smallest projection error of the snapshots u_s (Sirovich 1987), here in the
norm |u|^2 = u^T K_0 u with the stiffness K_0 of the straight robot. A Galerkin solution is optimal in the energy, so this norm
keeps the stiff, small motions (stretch, warping) without which a bending body locks. With the Gram matrix G = U K_0 U^T = V S
V^T,

    Phi = U^T V_r S_r^(-1/2),      Phi^T K_0 Phi = I,      q = Phi^T K_0 u.

Where each snapshot counts with the norm 1, it is the relative error that is smallest: of a robot so soft that it falls over when
it is released, the fallen shapes have a hundred times the energy of those that are held, and would take all modes.
"""

from collections.abc import Callable

import numpy as np

# An eigenvalue below this fraction of the largest is rounding error.
_ROUNDING = 1e-12
# Of the median norm: a smaller snapshot counts less, as the solver's tolerance would count with it.
_SMALL = 1e-2


def energy_basis(
    snapshots: np.ndarray,
    stiffness: Callable[[np.ndarray], np.ndarray],
    modes: int,
    alike: bool = False,
    gram: np.ndarray | None = None,
) -> np.ndarray:
    """Return the basis Phi (n, r) of the snapshots (s, n), orthonormal in the stiffness.

    stiffness: multiplies (n, k) by K_0; alike: each snapshot counts with the norm 1; gram (s, s): G, where it is known. r is
    `modes`, or fewer if the snapshots have a lower rank.
    """
    gram = snapshots @ stiffness(snapshots.T) if gram is None else gram
    norm = np.sqrt(np.diag(gram))
    size = 1.0 / np.maximum(norm, max(_SMALL * float(np.median(norm)), np.finfo(float).tiny)) if alike else np.ones(len(norm))
    basis = snapshots.T @ (size[:, None] * principal_combinations(size[:, None] * gram * size, modes))
    # A second orthonormalisation removes the rounding error of the small modes.
    correction = np.linalg.cholesky(basis.T @ stiffness(basis))
    return np.linalg.solve(correction, basis.T).T


def principal_combinations(gram: np.ndarray, count: int) -> np.ndarray:
    """Return weights (s, k), k <= count, of the orthonormal principal combinations of s vectors with the Gram matrix (s, s)."""
    values, vectors = np.linalg.eigh(0.5 * (gram + gram.T))
    best = np.argsort(values)[::-1][:count]
    best = best[values[best] > _ROUNDING * values[best[0]]]
    return vectors[:, best] / np.sqrt(values[best])
