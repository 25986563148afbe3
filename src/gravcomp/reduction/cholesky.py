"""Cholesky's factor of a small dense matrix and its solves, for use inside compiled functions.

At some fifty unknowns a call of LAPACK costs as much as its arithmetic, and it could not be made from compiled code that is kept
on disk.
"""

import numpy as np
from numba import njit


@njit(cache=True, fastmath={"reassoc", "contract", "nsz", "arcp"})
def factorise(matrix: np.ndarray) -> bool:
    """Replace the lower triangle of a symmetric matrix (r, r) by its factor L; False where it is not positive definite."""
    r = len(matrix)
    column = np.empty(r)
    for k in range(r):
        pivot = matrix[k, k]
        if not pivot > 0.0:
            return False
        root = np.sqrt(pivot)
        matrix[k, k] = root
        for i in range(k + 1, r):
            matrix[i, k] /= root
            column[i] = matrix[i, k]
        for i in range(k + 1, r):
            row, factor = matrix[i], column[i]
            for j in range(k + 1, i + 1):
                row[j] -= factor * column[j]
    return True


@njit(cache=True, fastmath={"reassoc", "contract", "nsz", "arcp"})
def solve_rows(factor: np.ndarray, rows: np.ndarray) -> None:
    """Replace every row b of `rows` (k, r) by A^-1 b, where A = L L^T with L the lower triangle of `factor` (r, r)."""
    r = len(factor)
    for row in rows:
        for i in range(r):
            total, line = row[i], factor[i]
            for j in range(i):
                total -= line[j] * row[j]
            row[i] = total / line[i]
        for i in range(r - 1, -1, -1):
            line = factor[i]
            row[i] /= line[i]
            value = row[i]
            for j in range(i):
                row[j] -= line[j] * value
