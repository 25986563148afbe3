"""The part of a law's stress that is not linear in Green's strain, at a few points of the body in reduced coordinates; compiled.

A law's energy is that of St. Venant-Kirchhoff with its own lambda and mu of small strain, which `strain_polynomials` integrates
exactly, plus a deviation that is of third order in the strain. With H = G q at a point, F = I + H and Green's strain E,

    U(q) = 1/2 |eps(q)|^2 + sum w (W(E) - 1/2 E : C : E),     f += sum w B^T T,     T = S(E) - C : E,
    K += sum w (B^T (D - C) B + G^T T G),                     B = dE/dq,  D = dS/dE,

over the points and weights w > 0 of `cubature`. So force and stiffness are the derivatives of one energy, K is symmetric, and a
body of the law "svk" has no points. Two things follow from sampling only the deviation: an error of the cubature is a fraction of
a small force, so few points are enough; and the bending of the linear part stays free of the parasitic stretch for which
`strain_polynomials` was made (the deviation multiplies that stretch by a strain once more).
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from gravcomp.materials import laws
from gravcomp.materials.linear import add_linear_stress, add_linear_tangent
from gravcomp.mechanics.kinematics import green_strain
from gravcomp.reduction.row_products import add_row_products
from gravcomp.rounding import REORDERED


class LawDeviation(NamedTuple):
    """The points of a reduced model at which the law is evaluated.

    gradient G^T (r, 9 p), component by component of H = du/dX (row by row) and therein point by point; weight (p,) in m^3; law
    (p,) and constants (p, c) of `MaterialConstants`. G is in single precision, because reading it takes most of the time; the
    force is still the exact derivative of an energy, and the stiffness is that of the force to 1e-6.
    """

    gradient: np.ndarray
    weight: np.ndarray
    law: np.ndarray
    constants: np.ndarray


class DeviationPoint(NamedTuple):
    """The deviation at coordinates q: F (p, 3, 3), strain E (p, 6), w T (p, 6), and its force (r,)."""

    deformation: np.ndarray
    strain: np.ndarray
    stress: np.ndarray
    force: np.ndarray


class KeptStiffness(NamedTuple):
    """The deviation's stiffness at coordinates near by, which is used again while q has moved by less than `reach` from there.

    The deviation is a small part of the stiffness and changes little over such a distance, and so do Newton's steps and the
    compliance. The force, and with it the equilibrium, does not depend on it. lower (r, r): triangle; q (r,): where it was
    computed, NaN: nowhere. Both are written by `near_stiffness`; `forget` empties it.
    """

    lower: np.ndarray
    q: np.ndarray
    reach: float

    @staticmethod
    def none(size: int, reach: float) -> "KeptStiffness":
        """Return an empty one for `size` coordinates."""
        return KeptStiffness(np.zeros((size, size)), np.full(size, np.nan), reach)


@njit(cache=True, fastmath=REORDERED)
def deviating_stress(law: int, constants: np.ndarray, e: np.ndarray, s: np.ndarray, d: np.ndarray, tangent: bool) -> None:
    """Write T into s (6) for Green's strain e (6), and D - C into d (6, 6) if `tangent`; arguments as in `laws.stress`."""
    laws.stress(law, constants, e, s, d, tangent)
    add_linear_stress(-constants[0], -constants[1], e, s)
    if tangent:
        add_linear_tangent(constants[0], constants[1], -1.0, d)


@njit(cache=True, fastmath=REORDERED)
def deviation_at(of: LawDeviation, q: np.ndarray) -> DeviationPoint:
    """Return the deviation at q (r,)."""
    r, size = of.gradient.shape
    count = len(of.weight)
    force, h, piola = np.zeros(r), np.zeros(size), np.empty(size)
    f, e, stress = np.empty((count, 3, 3)), np.empty((count, 6)), np.empty((count, 6))
    if count == 0:
        return DeviationPoint(f, e, stress, force)
    i = 0
    while i + 4 <= r:  # four rows at a time: the sums are read and written less often
        g_0, g_1, g_2, g_3 = of.gradient[i], of.gradient[i + 1], of.gradient[i + 2], of.gradient[i + 3]
        q_0, q_1, q_2, q_3 = q[i], q[i + 1], q[i + 2], q[i + 3]
        for k in range(size):
            h[k] += q_0 * g_0[k] + q_1 * g_1[k] + q_2 * g_2[k] + q_3 * g_3[k]
        i += 4
    while i < r:
        g_0, q_0 = of.gradient[i], q[i]
        for k in range(size):
            h[k] += q_0 * g_0[k]
        i += 1
    s, d = np.empty(6), np.empty((6, 6))
    for p in range(count):
        for i in range(3):
            for j in range(3):
                f[p, i, j] = h[(3 * i + j) * count + p]
            f[p, i, i] += 1.0
        green_strain(f[p], e[p])
        deviating_stress(of.law[p], of.constants[p], e[p], s, d, False)
        for m in range(6):
            stress[p, m] = of.weight[p] * s[m]
        s_0, s_1, s_2, s_3, s_4, s_5 = stress[p]
        for i in range(3):  # F T
            x, y, z = f[p, i]
            piola[3 * i * count + p] = x * s_0 + y * s_3 + z * s_5
            piola[(3 * i + 1) * count + p] = x * s_3 + y * s_1 + z * s_4
            piola[(3 * i + 2) * count + p] = x * s_5 + y * s_4 + z * s_2
    i = 0
    while i + 4 <= r:
        g_0, g_1, g_2, g_3 = of.gradient[i], of.gradient[i + 1], of.gradient[i + 2], of.gradient[i + 3]
        f_0 = f_1 = f_2 = f_3 = 0.0
        for k in range(size):
            x = piola[k]
            f_0 += g_0[k] * x
            f_1 += g_1[k] * x
            f_2 += g_2[k] * x
            f_3 += g_3[k] * x
        force[i], force[i + 1], force[i + 2], force[i + 3] = f_0, f_1, f_2, f_3
        i += 4
    while i < r:
        g_0, f_0 = of.gradient[i], 0.0
        for k in range(size):
            f_0 += g_0[k] * piola[k]
        force[i] = f_0
        i += 1
    return DeviationPoint(f, e, stress, force)


@njit(cache=True)
def near_stiffness(of: LawDeviation, point: DeviationPoint, q: np.ndarray, kept: KeptStiffness) -> np.ndarray:
    """Return the lower triangle of the deviation's stiffness (r, r) at q (r,) or near by; `point` is that at q."""
    away = ((q - kept.q) ** 2).sum()
    if not away <= kept.reach**2:  # also true for NaN
        kept.lower[:] = 0.0
        kept.q[:] = q
        add_deviation_stiffness(of, point, kept.lower)
    return kept.lower


@njit(cache=True)
def forget(kept: KeptStiffness) -> None:
    """Let the stiffness be computed again where it is asked for next."""
    kept.q[:] = np.nan


@njit(cache=True, fastmath=REORDERED)
def add_deviation_stiffness(of: LawDeviation, point: DeviationPoint, matrix: np.ndarray) -> None:
    """Add the deviation's stiffness to the lower triangle of matrix (r, r).

    The stiffness is G^T A G, A (9, 9) the change of the first Piola-Kirchhoff stress by H at each point.
    """
    r, size = of.gradient.shape
    count = len(of.weight)
    if count == 0:
        return
    elasticity = _elasticity(of, point)
    row = np.empty(size, dtype=np.float32)
    for i in range(r):
        gradient = of.gradient[i]
        g_0, g_1, g_2 = gradient[:count], gradient[count : 2 * count], gradient[2 * count : 3 * count]
        g_3, g_4, g_5 = gradient[3 * count : 4 * count], gradient[4 * count : 5 * count], gradient[5 * count : 6 * count]
        g_6, g_7, g_8 = gradient[6 * count : 7 * count], gradient[7 * count : 8 * count], gradient[8 * count :]
        for a in range(9):
            e, to = elasticity[a], row[a * count : (a + 1) * count]
            for p in range(count):
                to[p] = (
                    e[0, p] * g_0[p] + e[1, p] * g_1[p] + e[2, p] * g_2[p] + e[3, p] * g_3[p] + e[4, p] * g_4[p]
                    + e[5, p] * g_5[p] + e[6, p] * g_6[p] + e[7, p] * g_7[p] + e[8, p] * g_8[p]
                )  # fmt: skip
        add_row_products(row, of.gradient, i + 1, matrix[i])


@njit(cache=True, fastmath=REORDERED)
def _elasticity(of: LawDeviation, point: DeviationPoint) -> np.ndarray:
    """Return w A (9, 9, p) of every point, in single precision."""
    count = len(of.weight)
    elasticity = np.empty((9, 9, count), dtype=np.float32)
    s, d = np.empty(6), np.empty((6, 6))
    b, db = np.zeros((6, 9)), np.empty((6, 9))
    t = np.empty((3, 3))
    for p in range(count):
        f, w = point.deformation[p], of.weight[p]
        deviating_stress(of.law[p], of.constants[p], point.strain[p], s, d, True)
        t[0, 0], t[1, 1], t[2, 2] = w * s[0], w * s[1], w * s[2]
        t[0, 1] = t[1, 0] = w * s[3]
        t[1, 2] = t[2, 1] = w * s[4]
        t[0, 2] = t[2, 0] = w * s[5]
        for i in range(3):  # dE/dH
            x, y, z = f[i]
            b[0, 3 * i] = b[3, 3 * i + 1] = b[5, 3 * i + 2] = x
            b[1, 3 * i + 1] = b[3, 3 * i] = b[4, 3 * i + 2] = y
            b[2, 3 * i + 2] = b[4, 3 * i + 1] = b[5, 3 * i] = z
        for m in range(6):
            for a in range(9):
                value = 0.0
                for n in range(6):
                    value += d[m, n] * b[n, a]
                db[m, a] = w * value
        for a in range(9):
            for c in range(a + 1):
                value = t[a % 3, c % 3] if a // 3 == c // 3 else 0.0
                for m in range(6):
                    value += b[m, a] * db[m, c]
                elasticity[a, c, p] = elasticity[c, a, p] = np.float32(value)
    return elasticity
