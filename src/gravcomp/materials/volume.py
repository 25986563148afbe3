"""The part of every law that depends on the volume alone, U = kappa/2 (theta - theta_0)^2; compiled by Numba.

theta is tr E for the law that is linear in Green's strain, and J for the laws of the invariants. Quadratic tetrahedra lock where
theta is kappa-stiff at each of their points: a slender tube of them bends 1.9 % too stiffly at a Poisson's ratio of 0.45, and 9 %
at 0.4999. There U takes the mean of theta in the element instead (mean dilatation: J. C. Nagtegaal, D. M. Parks, J. R. Rice,
Comput. Methods Appl. Mech. Eng. 4, 1974; J. C. Simo, R. L. Taylor, K. S. Pister, same journal 51, 1985). With kappa (theta_mean -
theta) added to the pressure,

    S = S(E) + kappa (theta_mean - theta) dtheta/dE,
    D = D(E) + kappa (theta_mean - theta) d^2 theta/dE^2 - kappa dtheta/dE x dtheta/dE,

and the stiffness of an element of volume V has in addition kappa / V g x g, g = sum w B^T dtheta/dE.
"""

import numpy as np
from numba import njit

from gravcomp.materials.cauchy_green import TENSOR_INDICES, cauchy_green, component
from gravcomp.materials.invariants import bulk_modulus
from gravcomp.rounding import REORDERED


@njit(cache=True, fastmath=REORDERED)
def volume_measure(law: int, e: np.ndarray, slope: np.ndarray) -> float:
    """Return theta for the strain e (6), and write dtheta/dE into slope (6). law: code of `laws.LAWS`."""
    if law == 0:
        for k in range(3):
            slope[k] = 1.0
            slope[3 + k] = 0.0
        return e[0] + e[1] + e[2]
    _, inverse, j = cauchy_green(e)
    slope[0], slope[1], slope[2] = j * inverse[0], j * inverse[1], j * inverse[2]
    slope[3], slope[4], slope[5] = j * inverse[3], j * inverse[4], j * inverse[5]
    return j


@njit(cache=True, fastmath=REORDERED)
def add_mean_volume(
    law: int, constants: np.ndarray, e: np.ndarray, mean: float, slope: np.ndarray, s: np.ndarray, d: np.ndarray, tangent: bool
) -> None:
    """Change the stress s (6), and its tangent d (6, 6) if `tangent`, to those with the mean of theta in U.

    The tangent is that at a constant mean. slope (6): dtheta/dE, is written.
    """
    bulk = bulk_modulus(constants)
    theta = volume_measure(law, e, slope)
    pressure = bulk * (mean - theta)
    for m in range(6):
        s[m] += pressure * slope[m]
    if not tangent:
        return
    for m in range(6):
        for n in range(6):
            d[m, n] -= bulk * slope[m] * slope[n]
    if law == 0:
        return
    for m in range(6):
        mi, mj = TENSOR_INDICES[m]
        for n in range(6):
            ni, nj = TENSOR_INDICES[n]
            # With J C^-1 = slope: d(J C^-1)/dE = J C^-1 x C^-1 - J (C^-1 . C^-1 + ...).
            mixed = component(slope, mi, ni) * component(slope, mj, nj) + component(slope, mi, nj) * component(slope, mj, ni)
            d[m, n] += pressure * (slope[m] * slope[n] - mixed) / theta


@njit(cache=True, fastmath=REORDERED)
def mean_volume_energy(constants: np.ndarray, square: float, sum_of_squares: float) -> float:
    """Return what U of an element changes in J: square: V theta_mean^2; sum_of_squares: sum w theta^2, both in m^3."""
    return 0.5 * bulk_modulus(constants) * (square - sum_of_squares)
