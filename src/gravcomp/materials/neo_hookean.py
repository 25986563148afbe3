"""Compressible neo-Hookean law in the form of CalculiX and Abaqus, W = mu/2 (J^(-2/3) I1 - 3) + kappa/2 (J - 1)^2.

It is the law of Gaussian chains and fits rubber and silicone up to a stretch of about 1.5 (Bonet and Wood 2008, chapter 6).
"""

import numpy as np
from numba import njit

from gravcomp.materials.invariants import bulk_modulus, invariants, stress_of_invariants
from gravcomp.rounding import REORDERED


@njit(cache=True, fastmath=REORDERED)
def stress(constants: np.ndarray, e: np.ndarray, s: np.ndarray, d: np.ndarray, tangent: bool) -> None:
    """Second Piola-Kirchhoff stress into s (6), and dS/dE into d (6, 6) if `tangent`. constants: lambda, mu in Pa."""
    stress_of_invariants(0.5 * constants[1], 0.0, 0.0, bulk_modulus(constants), e, s, d, tangent)


@njit(cache=True, fastmath=REORDERED)
def energy(constants: np.ndarray, e: np.ndarray) -> float:
    """Energy density W in J/m^3."""
    first, _, j = invariants(e)
    return 0.5 * constants[1] * (first - 3.0) + 0.5 * bulk_modulus(constants) * (j - 1.0) ** 2
