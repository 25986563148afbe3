"""Forces of the walls on the rod, compiled.

A wall pushes with k times the depth of a point behind its plane. A rigid one has a stiffness at which the depth cannot be measured
(see `rigid_stiffness`); with the implicit time step it is a stiff potential, so that it takes no energy and gives none back that
was not in it. Friction sticks with the same stiffness and slips at Coulomb's limit (return mapping):

    f_n = k max(0, -g) n,    f_t = the nearest to held - k u_t with |f_t| <= mu |f_n|

u_t: the tangential way of the point over the wall in this step; held: f_t at its beginning. As an implicit penalty method for rods:
D. Tong, A. Choi, J. Joo, M. K. Jawed, "A fully implicit method for robust frictional contact handling in elastic rods", Extreme
Mech. Lett. 58, 2023; the return mapping: P. Wriggers, "Computational Contact Mechanics", 2006, chapter 5.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

_STIFFER = 30.0  # a rigid wall than the stiffest element


class Touching(NamedTuple):
    """Points that can touch, and the forces on them: c at most, of which the first `count[0]` are in use. In the fixed frame.

    slot and row (c,) int: number of the point and of the obstacle's row, by which friction is carried on; section (c,) int: A, before
    the point; weight (c, 2), arm (c, 2, 3) m: of A and B, see surface.py; normal (c, 3): out of the wall; plane (c,) m: the gap is
    normal . x - plane; start (c, 3) m: the place that the point would have if it had stayed where it was on the wall; stiffness (c,)
    N/m; friction (c,); held (c, 3) N: tangential force at the beginning; force (c, 3) N: on the robot; gap (c,) m.
    """

    count: np.ndarray
    slot: np.ndarray
    row: np.ndarray
    section: np.ndarray
    weight: np.ndarray
    arm: np.ndarray
    normal: np.ndarray
    plane: np.ndarray
    start: np.ndarray
    stiffness: np.ndarray
    friction: np.ndarray
    held: np.ndarray
    force: np.ndarray
    gap: np.ndarray


def touching_of(points: int) -> Touching:
    """Return empty arrays for so many points."""
    c, whole = points, np.int64
    return Touching(
        np.zeros(1, whole), np.zeros(c, whole), np.zeros(c, whole), np.zeros(c, whole), np.zeros((c, 2)), np.zeros((c, 2, 3)),
        np.zeros((c, 3)), np.zeros(c), np.zeros((c, 3)), np.zeros(c), np.zeros(c), np.zeros((c, 3)), np.zeros((c, 3)), np.zeros(c),
    )  # fmt: skip


def rigid_stiffness(stiffness: np.ndarray, length: np.ndarray) -> float:
    """Return the stiffness (N/m) of a point on a rigid wall, from those of the elements (n, 6, 6) and their lengths (n,) m.

    A load that compresses the rod by 1 % presses a point 1 / 3000 of the shortest element's length into the wall.
    """
    return _STIFFER * float((stiffness[:, 2, 2] / length).max())


@njit(cache=True, error_model="numpy")
def surface_point(orientation: np.ndarray, position: np.ndarray, a: int, weight: float, arm: np.ndarray, x: np.ndarray) -> None:
    """Write the place of a surface point between the sections a and a + 1 to x (3,); weight is that of a."""
    r = orientation[a]
    for i in range(3):
        x[i] = weight * position[a, i] + r[i, 0] * arm[0, 0] + r[i, 1] * arm[0, 1] + r[i, 2] * arm[0, 2]
    if weight < 1.0:
        r = orientation[a + 1]
        for i in range(3):
            x[i] += (1.0 - weight) * position[a + 1, i] + r[i, 0] * arm[1, 0] + r[i, 1] * arm[1, 1] + r[i, 2] * arm[1, 2]


@njit(cache=True, error_model="numpy")
def add_contacts(
    touching: Touching, orientation: np.ndarray, position: np.ndarray, residual: np.ndarray, band: np.ndarray
) -> None:
    """Subtract the walls' forces from residual (n + 1, 6), and add their tangent to the band; write `touching.force` and `gap`."""
    x, slip, trial, at = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    tangent, jacobian, product = np.empty((3, 3)), np.empty((2, 3, 6)), np.empty((3, 6))
    for c in range(touching.count[0]):
        a, k, n = touching.section[c], touching.stiffness[c], touching.normal[c]
        surface_point(orientation, position, a, touching.weight[c, 0], touching.arm[c], x)
        gap = n[0] * x[0] + n[1] * x[1] + n[2] * x[2] - touching.plane[c]
        touching.gap[c] = gap
        force = touching.force[c]
        before0, before1, before2 = force[0], force[1], force[2]
        force[0], force[1], force[2] = 0.0, 0.0, 0.0
        if gap >= 0.0:
            continue
        push = -k * gap
        along = 0.0
        for i in range(3):
            slip[i] = x[i] - touching.start[c, i]
            along += slip[i] * n[i]
        size = 0.0
        for i in range(3):
            trial[i] = touching.held[c, i] - k * (slip[i] - along * n[i])
            size += trial[i] * trial[i]
        size = math.sqrt(size)
        limit = touching.friction[c] * push
        sticks = size <= limit
        part = 1.0 if sticks else limit / size
        # A slip that turns round from one iteration to the next has passed the place where it sticks: its tangent leads there.
        turned = trial[0] * before0 + trial[1] * before1 + trial[2] * before2 < 0.0
        for i in range(3):
            force[i] = push * n[i] + part * trial[i]
        for i in range(3):
            for j in range(3):
                across = (1.0 if i == j else 0.0) - n[i] * n[j]
                tangent[i, j] = k * n[i] * n[j]
                if limit > 0.0:
                    if sticks or turned:
                        tangent[i, j] += k * across
                    else:
                        t = trial[i] / size
                        tangent[i, j] += part * k * (across - t * trial[j] / size) + touching.friction[c] * k * t * n[j]
        for side in range(2):
            if touching.weight[c, side] == 0.0 or a + side == 0:
                continue
            _section_motion(orientation[a + side], touching.weight[c, side], touching.arm[c, side], jacobian[side])
            for j in range(6):
                residual[a + side, j] -= (
                    jacobian[side, 0, j] * force[0] + jacobian[side, 1, j] * force[1] + jacobian[side, 2, j] * force[2]
                )
            _add_turning(6 * (a + side - 1), orientation[a + side], touching.weight[c, side], touching.arm[c, side], force, at, band)
        middle = band.shape[1] // 2
        for column in range(2):
            if touching.weight[c, column] == 0.0 or a + column == 0:
                continue
            for i in range(3):
                for j in range(6):
                    product[i, j] = (
                        tangent[i, 0] * jacobian[column, 0, j]
                        + tangent[i, 1] * jacobian[column, 1, j]
                        + tangent[i, 2] * jacobian[column, 2, j]
                    )
            for side in range(2):
                if touching.weight[c, side] == 0.0 or a + side == 0:
                    continue
                first = 6 * (a + column - 1) - 6 * (a + side - 1) + middle
                for i in range(6):
                    for j in range(6):
                        band[6 * (a + side - 1) + i, first + j - i] += (
                            jacobian[side, 0, i] * product[0, j]
                            + jacobian[side, 1, i] * product[1, j]
                            + jacobian[side, 2, i] * product[2, j]
                        )


@njit(cache=True, error_model="numpy")
def _section_motion(r: np.ndarray, weight: float, arm: np.ndarray, out: np.ndarray) -> None:
    """Write how a surface point moves with a section, d x / d eta, to out (3, 6)."""
    for i in range(3):
        for j in range(3):
            out[i, j] = weight * r[i, j]
        out[i, 3] = r[i, 2] * arm[1] - r[i, 1] * arm[2]
        out[i, 4] = r[i, 0] * arm[2] - r[i, 2] * arm[0]
        out[i, 5] = r[i, 1] * arm[0] - r[i, 0] * arm[1]


@njit(cache=True, error_model="numpy")
def _add_turning(
    row: int, r: np.ndarray, weight: float, arm: np.ndarray, force: np.ndarray, f: np.ndarray, band: np.ndarray
) -> None:
    """Add how a force that is constant in the fixed frame changes in the frame of the turning section; f (3,) is scratch."""
    middle = band.shape[1] // 2
    for i in range(3):
        f[i] = r[0, i] * force[0] + r[1, i] * force[1] + r[2, i] * force[2]
    band[row, middle + 4] += weight * f[2]
    band[row, middle + 5] -= weight * f[1]
    band[row + 1, middle + 2] -= weight * f[2]
    band[row + 1, middle + 4] += weight * f[0]
    band[row + 2, middle + 1] += weight * f[1]
    band[row + 2, middle + 2] -= weight * f[0]
    product = arm[0] * f[0] + arm[1] * f[1] + arm[2] * f[2]
    for i in range(3):
        for j in range(3):
            band[row + 3 + i, middle + j - i] += (product if i == j else 0.0) - f[i] * arm[j]


@njit(cache=True, error_model="numpy")
def difference(known: Touching, found: Touching) -> float:
    """Return by how much (m) the gaps of the points in `found` that lie in a wall differ from those in `known`, at most.

    A point that is not known counts with its depth.
    """
    worst = 0.0
    for c in range(found.count[0]):
        if found.gap[c] >= 0.0:
            continue
        before = 0.0
        for other in range(known.count[0]):
            if known.slot[other] == found.slot[c] and known.row[other] == found.row[c]:
                before = known.gap[other]
        worst = max(worst, abs(found.gap[c] - before))
    return worst


@njit(cache=True, error_model="numpy")
def take_over(source: Touching, target: Touching) -> None:
    """Copy the points in use of one to the other."""
    target.count[0] = source.count[0]
    for c in range(source.count[0]):
        target.slot[c], target.row[c], target.section[c] = source.slot[c], source.row[c], source.section[c]
        target.plane[c], target.stiffness[c], target.friction[c] = source.plane[c], source.stiffness[c], source.friction[c]
        target.gap[c] = source.gap[c]
        for i in range(3):
            target.normal[c, i], target.start[c, i] = source.normal[c, i], source.start[c, i]
            target.held[c, i], target.force[c, i] = source.held[c, i], source.force[c, i]
            for side in range(2):
                target.weight[c, side] = source.weight[c, side]
                target.arm[c, side, i] = source.arm[c, side, i]
