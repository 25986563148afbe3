"""Deformation gradient and Green's strain at the quadrature points, F = I + du/dX and E = (F^T F - I) / 2, compiled by Numba.

Six components in the order 11 22 33 12 23 13, shear doubled.
"""

import numpy as np
from numba import njit

from gravcomp.rounding import REORDERED


@njit(cache=True, fastmath=REORDERED)
def deformation_gradient(u: np.ndarray, nodes: np.ndarray, gradient: np.ndarray, f: np.ndarray) -> None:
    """Write F (3, 3) at one point of an element.

    u (n, 3): displacements; nodes (c,) of the element; gradient (3, c): derivatives of the shape functions by X.
    """
    f[:, :] = 0.0
    for i in range(3):
        f[i, i] = 1.0
    for a in range(nodes.shape[0]):
        for i in range(3):
            value = u[nodes[a], i]
            for j in range(3):
                f[i, j] += value * gradient[j, a]


@njit(cache=True, fastmath=REORDERED)
def green_strain(f: np.ndarray, e: np.ndarray) -> None:
    """Write Green's strain e (6) of the deformation gradient f (3, 3)."""
    for k in range(3):
        e[k] = 0.5 * (f[0, k] * f[0, k] + f[1, k] * f[1, k] + f[2, k] * f[2, k] - 1.0)
    e[3] = f[0, 0] * f[0, 1] + f[1, 0] * f[1, 1] + f[2, 0] * f[2, 1]
    e[4] = f[0, 1] * f[0, 2] + f[1, 1] * f[1, 2] + f[2, 1] * f[2, 2]
    e[5] = f[0, 0] * f[0, 2] + f[1, 0] * f[1, 2] + f[2, 0] * f[2, 2]


@njit(cache=True, fastmath=REORDERED)
def strain_rate(f: np.ndarray, g: np.ndarray, e: np.ndarray) -> None:
    """Write the rate e (6) of Green's strain for the rate g (3, 3) of the deformation gradient f (3, 3)."""
    for k in range(3):
        e[k] = f[0, k] * g[0, k] + f[1, k] * g[1, k] + f[2, k] * g[2, k]
    for k, i, j in ((3, 0, 1), (4, 1, 2), (5, 0, 2)):
        e[k] = 0.0
        for m in range(3):
            e[k] += f[m, i] * g[m, j] + g[m, i] * f[m, j]


@njit(cache=True, fastmath=REORDERED)
def strain_matrix(f: np.ndarray, gradient: np.ndarray, b: np.ndarray) -> None:
    """Write B = dE/dq (6, 3 c), unknowns component by component, for f (3, 3) and gradient (3, c)."""
    c = gradient.shape[1]
    for i in range(3):
        f0, f1, f2 = f[i, 0], f[i, 1], f[i, 2]
        for a in range(c):
            g0, g1, g2 = gradient[0, a], gradient[1, a], gradient[2, a]
            column = i * c + a
            b[0, column] = f0 * g0
            b[1, column] = f1 * g1
            b[2, column] = f2 * g2
            b[3, column] = f0 * g1 + f1 * g0
            b[4, column] = f1 * g2 + f2 * g1
            b[5, column] = f0 * g2 + f2 * g0


@njit(cache=True, fastmath=REORDERED)
def strains(u: np.ndarray, connectivity: np.ndarray, gradients: np.ndarray, strain: np.ndarray) -> None:
    """Write Green's strain (k, p, 6) at all points. connectivity (k, c) nodes; gradients (k, p, 3, c)."""
    f = np.empty((3, 3))
    for k in range(connectivity.shape[0]):
        for p in range(gradients.shape[1]):
            deformation_gradient(u, connectivity[k], gradients[k, p], f)
            green_strain(f, strain[k, p])


@njit(cache=True)
def smallest_volume_ratio(u: np.ndarray, connectivity: np.ndarray, gradients: np.ndarray) -> float:
    """Return the smallest det F of all points, -inf if one is not a number. Arguments as in `strains`."""
    least = np.inf
    f = np.empty((3, 3))
    for k in range(connectivity.shape[0]):
        for p in range(gradients.shape[1]):
            deformation_gradient(u, connectivity[k], gradients[k, p], f)
            det = (
                f[0, 0] * (f[1, 1] * f[2, 2] - f[1, 2] * f[2, 1])
                - f[0, 1] * (f[1, 0] * f[2, 2] - f[1, 2] * f[2, 0])
                + f[0, 2] * (f[1, 0] * f[2, 1] - f[1, 1] * f[2, 0])
            )
            if not det > least:  # also true for NaN
                least = det
            if det != det:
                return -np.inf
    return least
