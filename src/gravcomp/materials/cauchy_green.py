"""The right Cauchy-Green tensor C = 2 E + I and its inverse, from which hyperelastic laws are built. Compiled by Numba."""

import numpy as np
from numba import njit

from gravcomp.rounding import REORDERED

TENSOR_INDICES = np.array([(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2)])
"""(6, 2): row and column of each of the six components."""


@njit(cache=True, fastmath=REORDERED)
def cauchy_green(e: np.ndarray, c: np.ndarray, inverse: np.ndarray) -> float:
    """Write C (6) and its inverse (6) for the strain e (6); return J = det F."""
    for k in range(3):
        c[k] = 2.0 * e[k] + 1.0
        c[3 + k] = e[3 + k]
    inverse[0] = c[1] * c[2] - c[4] * c[4]
    inverse[1] = c[0] * c[2] - c[5] * c[5]
    inverse[2] = c[0] * c[1] - c[3] * c[3]
    inverse[3] = c[4] * c[5] - c[3] * c[2]
    inverse[4] = c[3] * c[5] - c[0] * c[4]
    inverse[5] = c[3] * c[4] - c[1] * c[5]
    det = c[0] * inverse[0] + c[3] * inverse[3] + c[5] * inverse[5]
    for k in range(6):
        inverse[k] /= det
    return np.sqrt(det)


@njit(cache=True)
def component(c: np.ndarray, i: int, j: int) -> float:
    """Entry (i, j) of the symmetric tensor c (6)."""
    if i == j:
        return c[i]
    if i + j == 1:
        return c[3]
    return c[4] if i + j == 3 else c[5]
