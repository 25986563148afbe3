"""Compressible neo-Hookean law in the form of CalculiX and Abaqus, W = mu/2 (J^(-2/3) tr C - 3) + kappa/2 (J - 1)^2.

With g = mu J^(-2/3) and p = kappa J (J - 1), the second Piola-Kirchhoff stress is S = g (I - tr(C)/3 C^-1) + p C^-1
(Bonet and Wood 2008, chapter 6; the volumetric term is that of the two programs).
"""

import numpy as np
from numba import njit

from gravcomp.materials.cauchy_green import TENSOR_INDICES, cauchy_green, component
from gravcomp.rounding import REORDERED


@njit(cache=True, fastmath=REORDERED)
def stress(constants: np.ndarray, e: np.ndarray, s: np.ndarray, d: np.ndarray, tangent: bool) -> None:
    """Second Piola-Kirchhoff stress into s (6), and dS/dE into d (6, 6) if `tangent`. constants: lambda, mu in Pa."""
    shear = constants[1]
    bulk = constants[0] + 2.0 / 3.0 * shear
    c = np.empty(6)
    ci = np.empty(6)
    j = cauchy_green(e, c, ci)
    trace = c[0] + c[1] + c[2]
    g = shear * j ** (-2.0 / 3.0)
    pressure = bulk * j * (j - 1.0)
    for k in range(6):
        unit = 1.0 if k < 3 else 0.0
        s[k] = g * (unit - trace / 3.0 * ci[k]) + pressure * ci[k]
    if not tangent:
        return
    outer = 2.0 / 9.0 * g * trace + bulk * j * (2.0 * j - 1.0)
    product = 2.0 / 3.0 * g * trace - 2.0 * pressure
    for m in range(6):
        mi, mj = TENSOR_INDICES[m]
        um = 1.0 if m < 3 else 0.0
        for n in range(6):
            ni, nj = TENSOR_INDICES[n]
            un = 1.0 if n < 3 else 0.0
            mixed = component(ci, mi, ni) * component(ci, mj, nj) + component(ci, mi, nj) * component(ci, mj, ni)
            d[m, n] = outer * ci[m] * ci[n] + 0.5 * product * mixed - 2.0 / 3.0 * g * (um * ci[n] + un * ci[m])


@njit(cache=True, fastmath=REORDERED)
def energy(constants: np.ndarray, e: np.ndarray) -> float:
    """Energy density W in J/m^3."""
    shear = constants[1]
    bulk = constants[0] + 2.0 / 3.0 * shear
    c = np.empty(6)
    inverse = np.empty(6)
    j = cauchy_green(e, c, inverse)
    return 0.5 * shear * (j ** (-2.0 / 3.0) * (c[0] + c[1] + c[2]) - 3.0) + 0.5 * bulk * (j - 1.0) ** 2
