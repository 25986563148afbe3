"""St. Venant-Kirchhoff's law, S = lambda tr(E) I + 2 mu E with W = lambda/2 tr(E)^2 + mu E : E (Bonet and Wood 2008, chapter 6).

The stress is linear in Green's strain. In compression the law softens: the force on a bar falls from a stretch of 1 / sqrt(3)
down, that is from E = -1/3.
"""

import numpy as np
from numba import njit

from gravcomp.materials.linear import add_linear_stress, add_linear_tangent
from gravcomp.rounding import REORDERED

SOFTENING_STRAIN = -1.0 / 3.0
"""Green's strain of a compressed fibre below which the force on it falls."""


@njit(cache=True, fastmath=REORDERED)
def stress(constants: np.ndarray, e: np.ndarray, s: np.ndarray, d: np.ndarray, tangent: bool) -> None:
    """Second Piola-Kirchhoff stress into s (6), and dS/dE into d (6, 6) if `tangent`. constants: lambda, mu in Pa."""
    first, shear = constants[0], constants[1]
    for k in range(6):
        s[k] = 0.0
    add_linear_stress(first, shear, e, s)
    if tangent:
        d[:, :] = 0.0
        add_linear_tangent(first, shear, 1.0, d)


@njit(cache=True, fastmath=REORDERED)
def energy(constants: np.ndarray, e: np.ndarray) -> float:
    """Energy density W in J/m^3."""
    trace = e[0] + e[1] + e[2]
    square = e[0] * e[0] + e[1] * e[1] + e[2] * e[2] + 0.5 * (e[3] * e[3] + e[4] * e[4] + e[5] * e[5])
    return 0.5 * constants[0] * trace * trace + constants[1] * square
