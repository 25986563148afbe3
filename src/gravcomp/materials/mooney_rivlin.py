"""Mooney-Rivlin law, W = c10 (I1 J^(-2/3) - 3) + c01 (I2 J^(-4/3) - 3) + kappa/2 (J - 1)^2 (Mooney 1940, Rivlin 1948).

2 (c10 + c01) = mu, the shear modulus of small strain, and c01 / c10 is the law's own constant `c01_ratio`. Published constants
are therefore given as youngs_modulus = 4 (1 + nu) (c10 + c01) and c01_ratio = c01 / c10. The default 0.25 is a usual value for
vulcanised rubber (Treloar, The Physics of Rubber Elasticity, 1975, section 10.5).
"""

import numpy as np
from numba import njit

from gravcomp.materials.invariants import bulk_modulus, invariants, stress_of_invariants
from gravcomp.rounding import REORDERED


@njit(cache=True, fastmath=REORDERED)
def _coefficients(constants: np.ndarray) -> tuple[float, float]:
    """Return c10 and c01 in Pa."""
    c10 = 0.5 * constants[1] / (1.0 + constants[2])
    return c10, constants[2] * c10


@njit(cache=True, fastmath=REORDERED)
def stress(constants: np.ndarray, e: np.ndarray, s: np.ndarray, d: np.ndarray, tangent: bool) -> None:
    """Second Piola-Kirchhoff stress into s (6), and dS/dE into d (6, 6) if `tangent`.

    constants: lambda and mu in Pa, c01 / c10.
    """
    c10, c01 = _coefficients(constants)
    stress_of_invariants(c10, 0.0, c01, bulk_modulus(constants), e, s, d, tangent)


@njit(cache=True, fastmath=REORDERED)
def energy(constants: np.ndarray, e: np.ndarray) -> float:
    """Energy density W in J/m^3."""
    c10, c01 = _coefficients(constants)
    first, second, j = invariants(e)
    return c10 * (first - 3.0) + c01 * (second - 3.0) + 0.5 * bulk_modulus(constants) * (j - 1.0) ** 2
