"""The right Cauchy-Green tensor C = 2 E + I and its inverse, from which hyperelastic laws are built. Compiled by Numba."""

import numpy as np
from numba import njit

from gravcomp.rounding import REORDERED

TENSOR_INDICES = np.array([(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2)])
"""(6, 2): row and column of each of the six components."""


Components = tuple[float, float, float, float, float, float]
"""The components of a symmetric tensor. Not an array: a compiled function would allocate one at every point of a body."""


@njit(cache=True, fastmath=REORDERED)
def cauchy_green(e: np.ndarray) -> tuple[Components, Components, float]:
    """Return C and its inverse for the strain e (6), and J = det F."""
    c_0, c_1, c_2 = 2.0 * e[0] + 1.0, 2.0 * e[1] + 1.0, 2.0 * e[2] + 1.0
    c_3, c_4, c_5 = e[3], e[4], e[5]
    i_0, i_1, i_2 = c_1 * c_2 - c_4 * c_4, c_0 * c_2 - c_5 * c_5, c_0 * c_1 - c_3 * c_3
    i_3, i_4, i_5 = c_4 * c_5 - c_3 * c_2, c_3 * c_5 - c_0 * c_4, c_3 * c_4 - c_1 * c_5
    det = c_0 * i_0 + c_3 * i_3 + c_5 * i_5
    over = 1.0 / det
    inverse = i_0 * over, i_1 * over, i_2 * over, i_3 * over, i_4 * over, i_5 * over
    return (c_0, c_1, c_2, c_3, c_4, c_5), inverse, np.sqrt(det)


@njit(cache=True)
def component(c: np.ndarray, i: int, j: int) -> float:
    """Entry (i, j) of the symmetric tensor c (6)."""
    if i == j:
        return c[i]
    if i + j == 1:
        return c[3]
    return c[4] if i + j == 3 else c[5]
