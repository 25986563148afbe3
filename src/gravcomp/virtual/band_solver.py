"""Solution of the rod's linear systems: a band matrix plus one update of rank one for each tendon, compiled.

The band comes from `assemble` of forces.py: each cross-section couples with its two neighbours, which makes 11 diagonals on
either side, and more where chords of tendons reach over several elements.
"""

import numpy as np
from numba import njit


@njit(cache=True, error_model="numpy")
def solve(band: np.ndarray, right_sides: np.ndarray) -> None:
    """Solve in place: band (N, 2 w + 1) holds a matrix with w diagonals on either side, right_sides (N, r) becomes the solution.

    There is no pivoting: the tangent at a stable equilibrium is positive definite, and inertia adds to that.
    """
    size, width, columns = band.shape[0], band.shape[1] // 2, right_sides.shape[1]
    for k in range(size):
        pivot = 1.0 / band[k, width]
        last = min(size, k + width + 1)
        for i in range(k + 1, last):
            shift = k - i + width
            factor = band[i, shift] * pivot
            if factor == 0.0:
                continue
            for j in range(1, last - k):
                band[i, shift + j] -= factor * band[k, width + j]
            for c in range(columns):
                right_sides[i, c] -= factor * right_sides[k, c]
    for k in range(size - 1, -1, -1):
        last = min(size, k + width + 1)
        for j in range(k + 1, last):
            value = band[k, j - k + width]
            for c in range(columns):
                right_sides[k, c] -= value * right_sides[j, c]
        pivot = 1.0 / band[k, width]
        for c in range(columns):
            right_sides[k, c] *= pivot


@njit(cache=True, error_model="numpy")
def newton_step(
    band: np.ndarray, residual: np.ndarray, gradient: np.ndarray, pull: np.ndarray, spring: np.ndarray, compliance: np.ndarray
) -> np.ndarray:
    """Return the increment (6 n,) of the free cross-sections.

    It solves (band + pull diag(spring) gradient^T) increment = -residual. spring (m,) is dT_0 / d path in N/m, 0 for a slack
    tendon. The tendons enter by the Sherman-Morrison-Woodbury formula. band is overwritten. compliance (m,) is filled with how
    much the path of each tendon shortens in m for a tension of 1 N in it, in this system.
    """
    size, m = gradient.shape
    sides = np.empty((size, m + 1))
    for k in range(size):
        sides[k, 0] = -residual[1 + k // 6, k % 6]
        for c in range(m):
            sides[k, 1 + c] = pull[k, c]
    solve(band, sides)
    small, known = np.zeros((m, m)), np.zeros(m)
    for a in range(m):
        small[a, a] = 1.0
        compliance[a] = 0.0
        for k in range(size):
            compliance[a] += gradient[k, a] * sides[k, 1 + a]
        if spring[a] == 0.0:
            continue
        for k in range(size):
            g = spring[a] * gradient[k, a]
            known[a] += g * sides[k, 0]
            for b in range(m):
                small[a, b] += g * sides[k, 1 + b]
    correction = _solve_small(small, known)
    increment = np.empty(size)
    for k in range(size):
        increment[k] = sides[k, 0]
        for c in range(m):
            increment[k] -= sides[k, 1 + c] * correction[c]
    return increment


@njit(cache=True, error_model="numpy")
def _solve_small(matrix: np.ndarray, right_side: np.ndarray) -> np.ndarray:
    """Return the solution (n,) by Gauss elimination with pivoting; both arguments are overwritten."""
    n = matrix.shape[0]
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(matrix[i, k]) > abs(matrix[best, k]):
                best = i
        if best != k:
            for j in range(n):
                matrix[k, j], matrix[best, j] = matrix[best, j], matrix[k, j]
            right_side[k], right_side[best] = right_side[best], right_side[k]
        for i in range(k + 1, n):
            factor = matrix[i, k] / matrix[k, k]
            for j in range(k, n):
                matrix[i, j] -= factor * matrix[k, j]
            right_side[i] -= factor * right_side[k]
    for k in range(n - 1, -1, -1):
        for j in range(k + 1, n):
            right_side[k] -= matrix[k, j] * right_side[j]
        right_side[k] /= matrix[k, k]
    return right_side
