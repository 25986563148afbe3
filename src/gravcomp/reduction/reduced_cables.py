"""The cables in reduced coordinates: straight pieces e_k(q) = e_k(0) + D_k q, lengths, Jacobian and stiffness, compiled."""

from typing import NamedTuple

import numpy as np
from numba import njit

from gravcomp.rounding import REORDERED


class ReducedCables(NamedTuple):
    """The cables of a reduced model.

    rest (s, 3): e_k(0) in m; change (3 s, r): D_k; cable (s,): cable of each straight piece; rest_length (m,) of the paths in m;
    axial_compliance (m,) from capstan to end in m/N, without friction; friction (m,) coefficient; sheath_angle (m,) in rad and
    free_length (m,) in m between capstan and robot.
    """

    rest: np.ndarray
    change: np.ndarray
    cable: np.ndarray
    rest_length: np.ndarray
    axial_compliance: np.ndarray
    friction: np.ndarray
    sheath_angle: np.ndarray
    free_length: np.ndarray


class ReducedTendons(NamedTuple):
    """The cables at coordinates q.

    tangent (s, 3), length (s,) and share (s,) of the pieces: tension over that at the capstan; mean_share (m,): its mean along
    each cable; displacement (m,) of the paths in m; jacobian (m, r): its derivative by q; force_jacobian (m, r): its transpose
    times the tensions is the cables' force.
    """

    tangent: np.ndarray
    length: np.ndarray
    share: np.ndarray
    mean_share: np.ndarray
    displacement: np.ndarray
    jacobian: np.ndarray
    force_jacobian: np.ndarray


@njit(cache=True, fastmath=REORDERED)
def tendons_at(cables: ReducedCables, q: np.ndarray, pulling: np.ndarray) -> ReducedTendons:
    """Return the cables at q (r,). pulling (m,): 1 for a cable that is pulled in, -1 for one paid out, 0 for no friction."""
    count, r = len(cables.cable), len(q)
    tangent, length = np.empty((count, 3)), np.empty(count)
    displacement, jacobian = cables.rest_length.copy(), np.zeros((len(cables.rest_length), r))
    for k in range(count):
        of_x, of_y, of_z = cables.change[3 * k], cables.change[3 * k + 1], cables.change[3 * k + 2]
        x, y, z = cables.rest[k, 0], cables.rest[k, 1], cables.rest[k, 2]
        for a in range(r):
            x += of_x[a] * q[a]
            y += of_y[a] * q[a]
            z += of_z[a] * q[a]
        length[k] = np.sqrt(x * x + y * y + z * z)
        displacement[cables.cable[k]] -= length[k]
        x, y, z = x / length[k], y / length[k], z / length[k]
        tangent[k, 0], tangent[k, 1], tangent[k, 2] = x, y, z
        row = jacobian[cables.cable[k]]
        for a in range(r):
            row[a] -= x * of_x[a] + y * of_y[a] + z * of_z[a]
    share, mean_share, force_jacobian = np.ones(count), np.ones(len(pulling)), jacobian
    for i in range(len(pulling)):
        if cables.friction[i] * pulling[i] != 0.0:
            force_jacobian = _with_friction(cables, tangent, cables.friction * pulling, share, r)
            _mean_shares(cables, length, cables.friction * pulling, share, mean_share)
            break
    return ReducedTendons(tangent, length, share, mean_share, displacement, jacobian, force_jacobian)


@njit(cache=True, fastmath=REORDERED)
def _with_friction(cables: ReducedCables, tangent: np.ndarray, friction: np.ndarray, share: np.ndarray, r: int) -> np.ndarray:
    """Write the share (s,) of capstan friction, as `cables.friction` does, and return the force Jacobian (m, r).

    friction (m,): coefficient with the sign of the sliding direction.
    """
    jacobian = np.zeros((len(friction), r))
    turned = 0.0
    for k in range(len(cables.cable)):
        i = cables.cable[k]
        x, y, z = tangent[k]
        if k > 0 and cables.cable[k - 1] == i:
            before = tangent[k - 1]
            turned += np.arccos(max(-1.0, min(1.0, x * before[0] + y * before[1] + z * before[2])))
        else:
            turned = cables.sheath_angle[i]
        share[k] = np.exp(-friction[i] * turned)
        x, y, z = share[k] * x, share[k] * y, share[k] * z
        row = jacobian[i]
        of_x, of_y, of_z = cables.change[3 * k], cables.change[3 * k + 1], cables.change[3 * k + 2]
        for a in range(r):
            row[a] -= x * of_x[a] + y * of_y[a] + z * of_z[a]
    return jacobian


@njit(cache=True)
def _mean_shares(cables: ReducedCables, length: np.ndarray, friction: np.ndarray, share: np.ndarray, mean: np.ndarray) -> None:
    """Write the mean share (m,), as `cables.friction` does, of pieces with length (s,) and share (s,); friction as above."""
    total = cables.free_length.copy()
    for i in range(len(friction)):
        turn = friction[i] * cables.sheath_angle[i]
        mean[i] = cables.free_length[i] * (-np.expm1(-turn) / turn if abs(turn) > 1e-9 else 1.0)
    for k in range(len(cables.cable)):
        i = cables.cable[k]
        mean[i] += share[k] * length[k]
        total[i] += length[k]
    for i in range(len(friction)):
        mean[i] /= total[i]


@njit(cache=True)
def stretch(cables: ReducedCables, tendons: ReducedTendons) -> np.ndarray:
    """Return the elongation (m,) of each cable under unit tension at its capstan, in m/N."""
    return cables.axial_compliance * tendons.mean_share


@njit(cache=True, fastmath=REORDERED)
def add_stiffness(cables: ReducedCables, tendons: ReducedTendons, tension: np.ndarray, matrix: np.ndarray) -> None:
    """Add the geometric stiffness of cables under the tensions (m,) to the lower triangle of matrix (r, r).

    The stiffness of a piece is tension / length D^T (I - t t^T) D, where I - t t^T = a a^T + b b^T with two unit vectors across
    t. So the sum over all pieces is R^T R with the rows sqrt(tension / length) a^T D and sqrt(tension / length) b^T D.
    """
    r = len(matrix)
    rows, used = np.empty((2 * len(cables.cable) + 3, r)), 0
    for k in range(len(cables.cable)):
        root = np.sqrt(tendons.share[k] * tension[cables.cable[k]] / tendons.length[k])
        if root == 0.0:
            continue
        x, y, z = tendons.tangent[k]
        # Duff et al., Building an orthonormal basis, revisited (JCGT 2017).
        sign = 1.0 if z >= 0.0 else -1.0
        p = -1.0 / (sign + z)
        s = x * y * p
        a_x, a_y, a_z = root * (1.0 + sign * x * x * p), root * sign * s, -root * sign * x
        b_x, b_y, b_z = root * s, root * (sign + y * y * p), -root * y
        of_x, of_y, of_z = cables.change[3 * k], cables.change[3 * k + 1], cables.change[3 * k + 2]
        to_a, to_b = rows[used], rows[used + 1]
        for i in range(r):
            to_a[i] = a_x * of_x[i] + a_y * of_y[i] + a_z * of_z[i]
            to_b[i] = b_x * of_x[i] + b_y * of_y[i] + b_z * of_z[i]
        used += 2
    rows[used : used + 3] = 0.0
    for k in range(0, used, 4):
        r_0, r_1, r_2, r_3 = rows[k], rows[k + 1], rows[k + 2], rows[k + 3]
        for i in range(r):
            to, f_0, f_1, f_2, f_3 = matrix[i], r_0[i], r_1[i], r_2[i], r_3[i]
            for j in range(i + 1):
                to[j] += f_0 * r_0[j] + f_1 * r_1[j] + f_2 * r_2[j] + f_3 * r_3[j]


@njit(cache=True)
def lacking(
    cables: ReducedCables, tendons: ReducedTendons, tension: np.ndarray, compliance: np.ndarray, wound: np.ndarray
) -> np.ndarray:
    """Return the change of tension (m,) that approximately brings the cables to the displacements `wound` (m,), NaN: released.

    It is 0 for slack cables. compliance (m, m) in m/N.
    """
    change, elongation = np.zeros_like(tension), stretch(cables, tendons) * tension
    for i in range(len(tension)):
        gap = wound[i] - tendons.displacement[i] - elongation[i]
        if gap > 0.0 or (tension[i] > 0.0 and gap <= 0.0):  # false for NaN
            change[i] = gap / compliance[i, i]
    return change
