"""The cables in reduced coordinates: straight pieces e_k(q) = e_k(0) + D_k q, lengths, Jacobian and stiffness, compiled."""

from typing import NamedTuple

import numpy as np
from numba import njit

from gravcomp.reduction.row_products import add_row_products
from gravcomp.rounding import REORDERED


class ReducedCables(NamedTuple):
    """The cables of a reduced model.

    rest (3, s): e_k(0) in m; change (r, 3, s): D_k in single precision, the s straight pieces last, cable after cable, so that a
    step reads memory in order; cable (s,): cable of each piece; first (m + 1,): first piece of each cable, and s at the end;
    rest_length (m,) of the paths in m; axial_compliance (m,) from capstan to end in m/N, without friction; friction (m,)
    coefficient; sheath_angle (m,) in rad and free_length (m,) in m between capstan and robot.
    """

    rest: np.ndarray
    change: np.ndarray
    cable: np.ndarray
    first: np.ndarray
    rest_length: np.ndarray
    axial_compliance: np.ndarray
    friction: np.ndarray
    sheath_angle: np.ndarray
    free_length: np.ndarray


class ReducedTendons(NamedTuple):
    """The cables at coordinates q.

    tangent (3, s), length (s,) and share (s,) of the pieces: tension over that at the capstan; mean_share (m,): its mean along
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
    r, _, count = cables.change.shape
    tangent, change = cables.rest.copy(), cables.change.reshape(r, 3 * count)
    along, i = tangent.reshape(3 * count), 0
    while i + 4 <= r:  # four rows at a time: the sums are read and written less often
        d_0, d_1, d_2, d_3 = change[i], change[i + 1], change[i + 2], change[i + 3]
        q_0, q_1, q_2, q_3 = q[i], q[i + 1], q[i + 2], q[i + 3]
        for k in range(3 * count):
            along[k] += q_0 * d_0[k] + q_1 * d_1[k] + q_2 * d_2[k] + q_3 * d_3[k]
        i += 4
    while i < r:
        d_0, q_0 = change[i], q[i]
        for k in range(3 * count):
            along[k] += q_0 * d_0[k]
        i += 1
    length, displacement = np.empty(count), cables.rest_length.copy()
    for k in range(count):
        length[k] = np.sqrt(tangent[0, k] ** 2 + tangent[1, k] ** 2 + tangent[2, k] ** 2)
        displacement[cables.cable[k]] -= length[k]
        for a in range(3):
            tangent[a, k] /= length[k]
    jacobian = _shortening(cables, tangent)
    share, mean_share, force_jacobian = np.ones(count), np.ones(len(pulling)), jacobian
    for i in range(len(pulling)):
        if cables.friction[i] * pulling[i] != 0.0:
            _capstan(cables, tangent, cables.friction * pulling, share)
            _mean_shares(cables, length, cables.friction * pulling, share, mean_share)
            force_jacobian = _shortening(cables, share * tangent)
            break
    return ReducedTendons(tangent, length, share, mean_share, displacement, jacobian, force_jacobian)


@njit(cache=True, fastmath=REORDERED)
def _shortening(cables: ReducedCables, direction: np.ndarray) -> np.ndarray:
    """Return by how much (m, r) each cable's pieces become shorter along their directions (3, s), for unit changes of q."""
    r, _, count = cables.change.shape
    shorter, part, first = np.empty((len(cables.rest_length), r)), np.empty(count), cables.first
    u_0, u_1, u_2 = direction[0], direction[1], direction[2]
    for i in range(r):
        d_0, d_1, d_2 = cables.change[i, 0], cables.change[i, 1], cables.change[i, 2]
        for k in range(count):
            part[k] = u_0[k] * d_0[k] + u_1[k] * d_1[k] + u_2[k] * d_2[k]
        for c in range(len(shorter)):
            value = 0.0
            for x in part[first[c] : first[c + 1]]:
                value -= x
            shorter[c, i] = value
    return shorter


@njit(cache=True)
def _capstan(cables: ReducedCables, tangent: np.ndarray, friction: np.ndarray, share: np.ndarray) -> None:
    """Write the share (s,) of capstan friction, as `cables.friction` does, for the tangents (3, s).

    friction (m,): coefficient with the sign of the sliding direction.
    """
    turned = 0.0
    for k in range(len(cables.cable)):
        i = cables.cable[k]
        if k > 0 and cables.cable[k - 1] == i:
            cosine = 0.0
            for a in range(3):
                cosine += tangent[a, k] * tangent[a, k - 1]
            turned += np.arccos(max(-1.0, min(1.0, cosine)))
        else:
            turned = cables.sheath_angle[i]
        share[k] = np.exp(-friction[i] * turned)


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
    t. So the sum over all pieces is R^T R with the rows sqrt(tension / length) a^T D and sqrt(tension / length) b^T D. It is a
    small part of the stiffness, for which single precision is enough.
    """
    r, _, count = cables.change.shape
    across = _across(cables, tendons, tension)
    parts = np.empty((r, 2, count), dtype=np.float32)
    for i in range(r):
        d_0, d_1, d_2 = cables.change[i, 0], cables.change[i, 1], cables.change[i, 2]
        for v in range(2):
            to, u_0, u_1, u_2 = parts[i, v], across[3 * v], across[3 * v + 1], across[3 * v + 2]
            for k in range(count):
                to[k] = u_0[k] * d_0[k] + u_1[k] * d_1[k] + u_2[k] * d_2[k]
    rows = parts.reshape(r, 2 * count)
    for i in range(r):
        add_row_products(rows[i], rows, i + 1, matrix[i])


@njit(cache=True, fastmath=REORDERED)
def _across(cables: ReducedCables, tendons: ReducedTendons, tension: np.ndarray) -> np.ndarray:
    """Return a and b (6, s) across each piece, times the root of tension over length, in single precision."""
    across = np.empty((6, len(cables.cable)), dtype=np.float32)
    for k in range(len(cables.cable)):
        root = np.sqrt(tendons.share[k] * tension[cables.cable[k]] / tendons.length[k])
        x, y, z = tendons.tangent[0, k], tendons.tangent[1, k], tendons.tangent[2, k]
        # Duff et al., Building an orthonormal basis, revisited (JCGT 2017).
        sign = 1.0 if z >= 0.0 else -1.0
        p = -1.0 / (sign + z)
        s = x * y * p
        across[0, k], across[1, k], across[2, k] = root * (1.0 + sign * x * x * p), root * sign * s, -root * sign * x
        across[3, k], across[4, k], across[5, k] = root * s, root * (sign + y * y * p), -root * y
    return across


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
