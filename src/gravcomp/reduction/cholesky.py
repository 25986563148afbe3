"""Cholesky factorisation and solution for a small dense matrix, for use inside compiled functions."""

import numpy as np
from numba import njit

from gravcomp.rounding import REORDERED


@njit(cache=True)
def factorise(matrix: np.ndarray) -> tuple[bool, np.ndarray]:
    """Return whether a symmetric matrix (r, r), given by its lower triangle, is positive definite, and if so its factor L."""
    try:
        factor = np.linalg.cholesky(matrix)
    except Exception:  # LinAlgError; compiled code can name no other class
        return False, matrix
    return np.isfinite(factor[-1, -1]), factor  # LAPACK does not stop at NaN, which then reaches the last entry


@njit(cache=True, fastmath=REORDERED)
def solve(factor: np.ndarray, columns: np.ndarray) -> None:
    """Replace `columns` B (r, k) by A^-1 B, where A = L L^T with L = `factor` (r, r).

    Handles all columns of a row together: for so few columns LAPACK spends most of its time on overhead.
    """
    r, k = columns.shape
    for i in range(r):
        line, to, j = factor[i], columns[i], 0
        while j + 4 <= i:
            l_0, l_1, l_2, l_3 = line[j], line[j + 1], line[j + 2], line[j + 3]
            x_0, x_1, x_2, x_3 = columns[j], columns[j + 1], columns[j + 2], columns[j + 3]
            for n in range(k):
                to[n] -= l_0 * x_0[n] + l_1 * x_1[n] + l_2 * x_2[n] + l_3 * x_3[n]
            j += 4
        while j < i:
            l_0, x_0 = line[j], columns[j]
            for n in range(k):
                to[n] -= l_0 * x_0[n]
            j += 1
        for n in range(k):
            to[n] /= line[i]
    for i in range(r - 1, -1, -1):
        line, of = factor[i], columns[i]
        for n in range(k):
            of[n] /= line[i]
        for j in range(i):
            l_0, to = line[j], columns[j]
            for n in range(k):
                to[n] -= l_0 * of[n]
