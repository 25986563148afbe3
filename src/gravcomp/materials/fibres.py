"""Reinforcement by fibres, W = c/2 sum_f (a_f . E a_f)^2: transverse isotropy of a braid or of fibres along the body.

The standard reinforcing model, quadratic in I4 - 1 = 2 a . E a (A. J. M. Spencer, Continuum Theory of the Mechanics of
Fibre-Reinforced Composites, 1984; G. A. Holzapfel, Nonlinear Solid Mechanics, 2000, section 6.7). It is added to any law of the
matrix. A family of fibres is the scaled tensor A = sqrt(c) a x a, in the order of the stress, so that

    W = 1/2 (A : E)^2,      S = (A : E) A,      D = A x A.

The stress is linear in Green's strain: a reduced model has it in its exact polynomials. Compiled by Numba.
"""

import numpy as np
from numba import njit

from gravcomp.rounding import REORDERED


@njit(cache=True, fastmath=REORDERED)
def add_fibre_stress(fibres: np.ndarray, e: np.ndarray, s: np.ndarray, d: np.ndarray, tangent: bool) -> None:
    """Add the stress of families A (f, 6) for Green's strain e (6) to s (6), and its tangent to d (6, 6) if `tangent`."""
    for f in range(fibres.shape[0]):
        a = fibres[f]
        stretch = 0.0
        for m in range(6):
            stretch += a[m] * e[m]
        for m in range(6):
            s[m] += stretch * a[m]
            if tangent:
                for n in range(6):
                    d[m, n] += a[m] * a[n]


@njit(cache=True, fastmath=REORDERED)
def fibre_energy(fibres: np.ndarray, e: np.ndarray) -> float:
    """Return the energy density in J/m^3 of families A (f, 6) for Green's strain e (6)."""
    total = 0.0
    for f in range(fibres.shape[0]):
        stretch = 0.0
        for m in range(6):
            stretch += fibres[f, m] * e[m]
        total += 0.5 * stretch * stretch
    return total
