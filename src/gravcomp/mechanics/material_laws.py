"""Material laws at a point: stress and its tangent from Green's strain, compiled by Numba.

St. Venant-Kirchhoff, S = lambda tr(E) I + 2 mu E; neo-Hookean in the form of CalculiX and Abaqus,
U = mu/2 (J^(-2/3) tr C - 3) + kappa/2 (J - 1)^2. Six components in the order 11 22 33 12 23 13; shear strains are doubled.
"""

import dataclasses

import numpy as np
from numba import njit

from gravcomp.mesh import Mesh

LAWS = {"svk": 0, "neo_hookean": 1}
# Reassociation lets the compiler use vector instructions; NaN keeps its meaning.
FAST = {"reassoc", "contract", "nsz", "arcp"}
# Tensor indices of the six components.
_PAIRS = np.array([(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2)])


@dataclasses.dataclass(frozen=True)
class Lame:
    """Material constants of every element: law (k,), lambda and mu (k,) in Pa, density (k,)."""

    law: np.ndarray
    first: np.ndarray
    shear: np.ndarray
    density: np.ndarray

    @staticmethod
    def of(mesh: Mesh) -> "Lame":
        """The constants that the mesh's materials give its elements."""
        young = np.array([m.youngs_modulus for m in mesh.materials])
        nu = np.array([m.poissons_ratio for m in mesh.materials])
        values = (
            np.array([LAWS[m.law] for m in mesh.materials], dtype=np.int64),
            young * nu / ((1 + nu) * (1 - 2 * nu)),
            young / (2 * (1 + nu)),
            np.array([m.density for m in mesh.materials]),
        )
        return Lame(*(v[mesh.region] for v in values))


@njit(cache=True, fastmath=FAST)
def linear_stress(first, shear, e, s):
    """Add the stress of linear isotropy for the strain e (6) to s (6)."""
    pressure = first * (e[0] + e[1] + e[2])
    for k in range(3):
        s[k] += pressure + 2.0 * shear * e[k]
        s[3 + k] += shear * e[3 + k]


@njit(cache=True, fastmath=FAST)
def inverse_cauchy_green(e, c, ci):
    """C (6) and its inverse (6) from Green's strain; returns det F."""
    for k in range(3):
        c[k] = 2.0 * e[k] + 1.0
        c[3 + k] = e[3 + k]
    ci[0] = c[1] * c[2] - c[4] * c[4]
    ci[1] = c[0] * c[2] - c[5] * c[5]
    ci[2] = c[0] * c[1] - c[3] * c[3]
    ci[3] = c[4] * c[5] - c[3] * c[2]
    ci[4] = c[3] * c[5] - c[0] * c[4]
    ci[5] = c[3] * c[4] - c[1] * c[5]
    det = c[0] * ci[0] + c[3] * ci[3] + c[5] * ci[5]
    for k in range(6):
        ci[k] /= det
    return np.sqrt(det)


@njit(cache=True, fastmath=FAST)
def stress(law, first, shear, e, s, d, tangent):
    """Second Piola-Kirchhoff stress s (6), and dS/dE into d (6, 6) when `tangent`."""
    if law == 0:
        for k in range(6):
            s[k] = 0.0
        linear_stress(first, shear, e, s)
        if tangent:
            add_linear_tangent(first, shear, 1.0, d, True)
        return
    c = np.empty(6)
    ci = np.empty(6)
    bulk = first + 2.0 / 3.0 * shear
    j = inverse_cauchy_green(e, c, ci)
    trace = c[0] + c[1] + c[2]
    g = shear * j ** (-2.0 / 3.0)
    pressure = bulk * j * (j - 1.0)
    for k in range(6):
        unit = 1.0 if k < 3 else 0.0
        s[k] = g * (unit - trace / 3.0 * ci[k]) + pressure * ci[k]
    if tangent:
        outer = 2.0 / 9.0 * g * trace + bulk * j * (2.0 * j - 1.0)
        product = 2.0 / 3.0 * g * trace - 2.0 * pressure
        for m in range(6):
            mi, mj = _PAIRS[m]
            um = 1.0 if m < 3 else 0.0
            for n in range(6):
                ni, nj = _PAIRS[n]
                un = 1.0 if n < 3 else 0.0
                mixed = _at(ci, mi, ni) * _at(ci, mj, nj) + _at(ci, mi, nj) * _at(ci, mj, ni)
                d[m, n] = outer * ci[m] * ci[n] + 0.5 * product * mixed - 2.0 / 3.0 * g * (um * ci[n] + un * ci[m])


@njit(cache=True)
def _at(c, i, j):
    """Entry (i, j) of the symmetric tensor c (6)."""
    if i == j:
        return c[i]
    if i + j == 1:
        return c[3]
    return c[4] if i + j == 3 else c[5]


@njit(cache=True, fastmath=FAST)
def add_linear_tangent(first, shear, factor, d, clear):
    """Add factor x linear isotropy to d (6, 6), cleared before when `clear`."""
    if clear:
        d[:, :] = 0.0
    for m in range(3):
        for n in range(3):
            d[m, n] += factor * first
        d[m, m] += factor * 2.0 * shear
        d[3 + m, 3 + m] += factor * shear
