"""Linear isotropic elasticity, S = C : E = lambda tr(E) I + 2 mu E, compiled by Numba.

The laws of damping and creep use it as well: they act on small rates of strain, and C is the stiffness of every law at small
strain.
"""

import numpy as np
from numba import njit

from gravcomp.rounding import REORDERED


@njit(cache=True, fastmath=REORDERED)
def add_linear_stress(first: float, shear: float, e: np.ndarray, s: np.ndarray) -> None:
    """Add the stress for the strain e (6) to s (6). first, shear: Lame's constants lambda and mu in Pa."""
    pressure = first * (e[0] + e[1] + e[2])
    for k in range(3):
        s[k] += pressure + 2.0 * shear * e[k]
        s[3 + k] += shear * e[3 + k]


@njit(cache=True, fastmath=REORDERED)
def add_linear_tangent(first: float, shear: float, factor: float, d: np.ndarray) -> None:
    """Add factor x C to d (6, 6)."""
    for m in range(3):
        for n in range(3):
            d[m, n] += factor * first
        d[m, m] += factor * 2.0 * shear
        d[3 + m, 3 + m] += factor * shear
