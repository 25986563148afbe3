"""How a section changes its form under load, compiled: it widens where it is compressed, by which lever arms grow.

A bar that is stretched by e contracts across to s(e) of its width, whose law gives s = exp(a e + q e^2), a = -nu for every law
without fibres (see law_curve.py). So a point of the section is at c + s (d - c) in place of d, c the centroid, and the filaments
and channels of a rod with the strain epsilon = (v, w) have the stretch that those of a section which keeps its width have with

    epsilon_s = (v + (1 - s) w x c, s w),    s = s(stretch of the centroid)

For a small bend of a bar under a finite stretch this is exact: with it M = s^2 (dP/de) I w, which is the solution of the
three-dimensional equations (A. E. Green, W. Zerna, Theoretical Elasticity, 1968, chapter IV: small deformations superposed on
finite deformation). Material and cables take epsilon_s, which is their own strain; forces follow from its energy:

    sigma = J^T sigma_s,    K = J^T K_s J + sum_i sigma_s,i d^2 epsilon_s,i,    J = d epsilon_s / d epsilon

Because s multiplies w, a bent section resists its stretch by M w s'/s: a cable along the inner side presses across on the body,
which stretches it. Ends that hold the section in its width are not regarded: they do so over about half the width.

In a bent section every filament contracts by its own stretch. With eta = kappa y its strain, zeta = kappa x, it moves by
a kappa (y^2 - x^2) / 2 across (anticlastic bending; A. E. H. Love, The Mathematical Theory of Elasticity, 1927, chapter V) and so
is stretched by delta = a (eta^2 - zeta^2 - mean) / 2 more. Of second order in the curvature, this gives the energy

    U_a = E c int eta^2 delta dA,    c: of the law's curve

It changes the stiffness in bending by the share 4/3 c a int eta^4 dA / int eta^2 dA in a round section: St. Venant-Kirchhoff's
law becomes softer, the others stiffer. Terms of the same order without c, of a section that becomes oval, are not regarded: in
a tube of 9/3.6 mm they are a fifth of that; thin tubes buckle by them (Brazier). So that U_a never outweighs the linear energy at
any curvature, it is divided by 1 + _BOUND |c a| (eta^2 mean).
"""

import math

import numpy as np
from numba import njit

_BOUND = 3.0  # U_a stays below four ninths of the linear energy
_FARTHEST = 1.0  # strain, beyond which the section keeps its width: an iteration on its way to the equilibrium may be there


def across_coefficients(filament: np.ndarray, curve: np.ndarray) -> np.ndarray:
    """Return the coefficients (8,) of U_a = Q(x, y) / (1 + q(x, y)): those of x^4, x^3 y, ... y^4 in Q, of x^2, x y, y^2 in q.

    x, y: curvatures beyond those at rest; filament (9, 3) and curve (5,): of one element.
    """
    size = filament[:, 2]
    b0, b1 = (filament[:, :2] - filament[-1, :2]).T
    square, mixed = b0**2 - b1**2, b0 * b1
    p, r = (value - size @ value / size.sum() for value in (square, mixed))
    quartic = np.array([b0**2 * p, 4 * b0**2 * r + 2 * mixed * p, (b1**2 - b0**2) * p + 8 * mixed * r,
                        4 * b1**2 * r - 2 * mixed * p, -(b1**2) * p])  # fmt: skip
    product = curve[0] * curve[3]
    return np.concatenate(
        [0.5 * product * quartic @ size, _BOUND * abs(product) * np.array([b0**2, 2 * mixed, b1**2]) @ size / size.sum()]
    )


@njit(cache=True, error_model="numpy", inline="always")
def across_energy(x: float, y: float, across: np.ndarray) -> float:
    """Return U_a of one element over its length, J/m."""
    high = x**4 * across[0] + x**3 * y * across[1] + x**2 * y**2 * across[2] + x * y**3 * across[3] + y**4 * across[4]
    return high / (1.0 + x * x * across[5] + x * y * across[6] + y * y * across[7])


@njit(cache=True, error_model="numpy", inline="always")
def add_across(x: float, y: float, across: np.ndarray, sigma: np.ndarray, tangent: np.ndarray) -> None:
    """Add stress (6,) and tangent (6, 6) of U_a in the curvatures x and y beyond those at rest."""
    a, b, c, d, e = across[0], across[1], across[2], across[3], across[4]
    high = x * x * (x * x * a + x * y * b + y * y * c) + y * y * (x * y * d + y * y * e)
    high_x = x * (4.0 * x * x * a + 3.0 * x * y * b + 2.0 * y * y * c) + y**3 * d
    high_y = x**3 * b + y * (2.0 * x * x * c + 3.0 * x * y * d + 4.0 * y * y * e)
    high_xx = 12.0 * x * x * a + 6.0 * x * y * b + 2.0 * y * y * c
    high_xy = 3.0 * x * x * b + 4.0 * x * y * c + 3.0 * y * y * d
    high_yy = 2.0 * x * x * c + 6.0 * x * y * d + 12.0 * y * y * e
    low_x, low_y = 2.0 * x * across[5] + y * across[6], x * across[6] + 2.0 * y * across[7]
    share = 1.0 / (1.0 + 0.5 * (x * low_x + y * low_y))
    energy = high * share
    slope_x, slope_y = (high_x - energy * low_x) * share, (high_y - energy * low_y) * share
    sigma[3] += slope_x
    sigma[4] += slope_y
    tangent[3, 3] += (high_xx - 2.0 * slope_x * low_x - 2.0 * energy * across[5]) * share
    mixed = (high_xy - slope_x * low_y - slope_y * low_x - energy * across[6]) * share
    tangent[3, 4] += mixed
    tangent[4, 3] += mixed
    tangent[4, 4] += (high_yy - 2.0 * slope_y * low_y - 2.0 * energy * across[7]) * share


@njit(cache=True, error_model="numpy")
def widened_strains(
    strain: np.ndarray, rest_strain: np.ndarray, filament: np.ndarray, curve: np.ndarray, out: np.ndarray
) -> None:
    """Write epsilon_s (n, 6) of all elements to out; strain, rest_strain (n, 6), filament (n, 9, 3), curve (n, 5): of the rod."""
    change = np.empty(6)
    for e in range(strain.shape[0]):
        widened(strain[e], rest_strain[e], filament[e], curve[e], out[e], change)


@njit(cache=True, error_model="numpy", inline="always")
def widened(
    strain: np.ndarray, rest_strain: np.ndarray, filament: np.ndarray, curve: np.ndarray, out: np.ndarray, change: np.ndarray
) -> tuple[float, float, float]:
    """Write epsilon_s (6,) of an element to out, and d epsilon_s / ds (6,) to change; return s, ds/de and d^2 s/de^2."""
    b0, b1 = filament[-1, 0], filament[-1, 1]  # the filament at the centroid: y and -x
    e = strain[2] - rest_strain[2] + (strain[3] - rest_strain[3]) * b0 + (strain[4] - rest_strain[4]) * b1
    held = min(max(e, -_FARTHEST), _FARTHEST)
    s = math.exp(held * (curve[3] + curve[4] * held))
    rate, second = 0.0, 0.0
    if held == e:
        slope = curve[3] + 2.0 * curve[4] * e
        rate, second = s * slope, s * (slope * slope + 2.0 * curve[4])
    change[0], change[1] = strain[5] * b0, strain[5] * b1
    change[2] = -strain[3] * b0 - strain[4] * b1
    change[3], change[4], change[5] = strain[3], strain[4], strain[5]
    for i in range(6):
        out[i] = strain[i] + (s - 1.0) * change[i]
    return s, rate, second


@njit(cache=True, error_model="numpy", inline="always")
def to_strain(stress: np.ndarray, filament: np.ndarray, s: float, rate: float, change: np.ndarray, out: np.ndarray) -> None:
    """Write J^T stress (6,) to out (6,); s, rate and change are those of `widened`."""
    b0, b1 = filament[-1, 0], filament[-1, 1]
    along = 0.0
    for i in range(6):
        along += stress[i] * change[i]
    along *= rate
    t = s - 1.0
    out[0], out[1] = stress[0], stress[1]
    out[2] = stress[2] + along
    out[3] = stress[3] + t * (stress[3] - b0 * stress[2]) + along * b0
    out[4] = stress[4] + t * (stress[4] - b1 * stress[2]) + along * b1
    out[5] = stress[5] + t * (stress[5] + b0 * stress[0] + b1 * stress[1])


@njit(cache=True, error_model="numpy", inline="always")
def tangent_to_strain(
    stress: np.ndarray, tangent: np.ndarray, filament: np.ndarray, s: float, rate: float, second: float, change: np.ndarray
) -> None:
    """Turn the symmetric tangent (6, 6) d sigma_s / d epsilon_s into d sigma / d epsilon, in place; stress (6,) is sigma_s."""
    b0, b1 = filament[-1, 0], filament[-1, 1]
    t = s - 1.0
    for i in range(6):  # columns: K_s J
        row = tangent[i]
        along = 0.0
        for j in range(6):
            along += row[j] * change[j]
        along *= rate
        row[3] += t * (row[3] - b0 * row[2]) + along * b0
        row[4] += t * (row[4] - b1 * row[2]) + along * b1
        row[5] += t * (row[5] + b0 * row[0] + b1 * row[1])
        row[2] += along
    for j in range(6):  # rows: J^T (K_s J)
        along = 0.0
        for i in range(6):
            along += tangent[i, j] * change[i]
        along *= rate
        tangent[3, j] += t * (tangent[3, j] - b0 * tangent[2, j]) + along * b0
        tangent[4, j] += t * (tangent[4, j] - b1 * tangent[2, j]) + along * b1
        tangent[5, j] += t * (tangent[5, j] + b0 * tangent[0, j] + b1 * tangent[1, j])
        tangent[2, j] += along
    # sigma_s d^2 epsilon_s: the widening changes with the stretch, and the arms with it
    bend = 0.0
    for i in range(6):
        bend += stress[i] * change[i]
    m3, m4 = stress[3] - b0 * stress[2], stress[4] - b1 * stress[2]
    m5 = stress[5] + b0 * stress[0] + b1 * stress[1]
    tangent[2, 2] += second * bend
    tangent[2, 3] += second * bend * b0 + rate * m3
    tangent[2, 4] += second * bend * b1 + rate * m4
    tangent[2, 5] += rate * m5
    tangent[3, 2] += second * bend * b0 + rate * m3
    tangent[4, 2] += second * bend * b1 + rate * m4
    tangent[5, 2] += rate * m5
    tangent[3, 3] += second * bend * b0 * b0 + 2.0 * rate * m3 * b0
    tangent[3, 4] += second * bend * b0 * b1 + rate * (m4 * b0 + m3 * b1)
    tangent[4, 3] += second * bend * b0 * b1 + rate * (m4 * b0 + m3 * b1)
    tangent[4, 4] += second * bend * b1 * b1 + 2.0 * rate * m4 * b1
    tangent[3, 5] += rate * m5 * b0
    tangent[5, 3] += rate * m5 * b0
    tangent[4, 5] += rate * m5 * b1
    tangent[5, 4] += rate * m5 * b1
