"""Laws of the invariants, W = W1(I1 J^(-2/3)) + w2 (I2 J^(-4/3) - 3) + kappa/2 (J - 1)^2, from which rubber's laws are built.

I1 = tr C, I2 = (I1^2 - tr C^2) / 2, J = det F. With w1 = dW1/dI1', w11 = d^2 W1/dI1'^2, a constant w2 and

    A1 = J^(-2/3) (I - I1/3 C^-1),      A2 = J^(-4/3) (I1 I - C - 2/3 I2 C^-1),      p = kappa J (J - 1),

the second Piola-Kirchhoff stress is S = 2 w1 A1 + 2 w2 A2 + p C^-1 (Holzapfel, Nonlinear Solid Mechanics, 2000, section 6.5; the
volumetric term is that of CalculiX and Abaqus). The laws depend on the shape by the first two terms and on the volume by the
last one, so that a nearly incompressible material is only a large kappa. Compiled by Numba.
"""

import numpy as np
from numba import njit

from gravcomp.materials.cauchy_green import TENSOR_INDICES, Components, cauchy_green, component
from gravcomp.rounding import REORDERED


@njit(cache=True, fastmath=REORDERED)
def bulk_modulus(constants: np.ndarray) -> float:
    """Return kappa in Pa from lambda and mu of small strain."""
    return constants[0] + 2.0 / 3.0 * constants[1]


@njit(cache=True, fastmath=REORDERED)
def invariants(e: np.ndarray) -> tuple[float, float, float]:
    """Return I1 J^(-2/3), I2 J^(-4/3) and J of the strain e (6)."""
    c, _, j = cauchy_green(e)
    root = j ** (-2.0 / 3.0)
    return root * (c[0] + c[1] + c[2]), root * root * _second(c), j


@njit(cache=True, fastmath=REORDERED)
def _second(c: Components) -> float:
    """Return I2 of C."""
    return c[0] * c[1] + c[1] * c[2] + c[2] * c[0] - c[3] * c[3] - c[4] * c[4] - c[5] * c[5]


@njit(cache=True, fastmath=REORDERED)
def stress_of_invariants(
    w1: float, w11: float, w2: float, bulk: float, e: np.ndarray, s: np.ndarray, d: np.ndarray, tangent: bool
) -> None:
    """Second Piola-Kirchhoff stress into s (6), and dS/dE into d (6, 6) if `tangent`; w1, w11, w2 and bulk (kappa) in Pa."""
    c, inverse, j = cauchy_green(e)
    first, second = c[0] + c[1] + c[2], _second(c)
    root = j ** (-2.0 / 3.0)
    g, h = 2.0 * w1 * root, 2.0 * w2 * root * root
    pressure = bulk * j * (j - 1.0)
    # S = of_unit I - h C + of_inverse C^-1.
    of_unit, of_inverse = g + h * first, pressure - g * first / 3.0 - 2.0 / 3.0 * h * second
    s[0] = of_unit - h * c[0] + of_inverse * inverse[0]
    s[1] = of_unit - h * c[1] + of_inverse * inverse[1]
    s[2] = of_unit - h * c[2] + of_inverse * inverse[2]
    s[3] = of_inverse * inverse[3] - h * c[3]
    s[4] = of_inverse * inverse[4] - h * c[4]
    s[5] = of_inverse * inverse[5] - h * c[5]
    if not tangent:
        return
    ci, green = np.array(inverse), np.array(c)
    unit, a, shape = np.empty(6), np.empty(6), np.empty(6)  # I, A1, I1 I - C
    for k in range(6):
        unit[k] = 1.0 if k < 3 else 0.0
        a[k] = root * (unit[k] - first / 3.0 * ci[k])
        shape[k] = first * unit[k] - green[k]
    outer = 2.0 / 9.0 * g * first + 8.0 / 9.0 * h * second + bulk * j * (2.0 * j - 1.0)
    product = 2.0 / 3.0 * g * first + 4.0 / 3.0 * h * second - 2.0 * pressure
    for m in range(6):
        mi, mj = TENSOR_INDICES[m]
        for n in range(m + 1):
            ni, nj = TENSOR_INDICES[n]
            mixed = component(ci, mi, ni) * component(ci, mj, nj) + component(ci, mi, nj) * component(ci, mj, ni)
            value = outer * ci[m] * ci[n] + 0.5 * product * mixed + 4.0 * w11 * a[m] * a[n]
            value -= 2.0 / 3.0 * g * (unit[m] * ci[n] + unit[n] * ci[m])
            value += h * (2.0 * unit[m] * unit[n] - 4.0 / 3.0 * (shape[m] * ci[n] + shape[n] * ci[m]))
            if m == n:
                value -= 2.0 * h if m < 3 else h
            d[m, n] = d[n, m] = value
