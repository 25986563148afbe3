"""Yeoh's law, W = c10 x + c20 x^2 + c30 x^3 + kappa/2 (J - 1)^2 with x = I1 J^(-2/3) - 3.

O. H. Yeoh, Rubber Chemistry and Technology 66, 1993. 2 c10 = mu, the shear modulus of small strain; c20 / c10 and c30 / c10
are the law's own constants `c20_ratio` and `c30_ratio`. Published constants are therefore given as youngs_modulus = 4 (1 +
nu) c10 and the two ratios. The default, 0.18 and 0, is that of the silicone Elastosil M4601 (c10 = 0.11 MPa, c20 = 0.02 MPa:
P. Polygerinos et al., IEEE Trans. Robotics 31, 2015).
"""

import numpy as np
from numba import njit

from gravcomp.materials.invariants import bulk_modulus, invariants, stress_of_invariants
from gravcomp.rounding import REORDERED


@njit(cache=True, fastmath=REORDERED)
def stress(constants: np.ndarray, e: np.ndarray, s: np.ndarray, d: np.ndarray, tangent: bool) -> None:
    """Second Piola-Kirchhoff stress into s (6), and dS/dE into d (6, 6) if `tangent`.

    constants: lambda and mu in Pa, c20 / c10, c30 / c10.
    """
    c10, second, third = 0.5 * constants[1], constants[2], constants[3]
    x = invariants(e)[0] - 3.0
    w1 = c10 * (1.0 + 2.0 * second * x + 3.0 * third * x * x)
    w11 = c10 * (2.0 * second + 6.0 * third * x)
    stress_of_invariants(w1, w11, 0.0, bulk_modulus(constants), e, s, d, tangent)


@njit(cache=True, fastmath=REORDERED)
def energy(constants: np.ndarray, e: np.ndarray) -> float:
    """Energy density W in J/m^3."""
    c10, second, third = 0.5 * constants[1], constants[2], constants[3]
    first, _, j = invariants(e)
    x = first - 3.0
    return c10 * x * (1.0 + second * x + third * x * x) + 0.5 * bulk_modulus(constants) * (j - 1.0) ** 2
