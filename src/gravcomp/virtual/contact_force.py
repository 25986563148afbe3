"""Forces of the walls on the rod, compiled.

A wall pushes with k times the depth of a point behind its plane. A rigid one has a stiffness at which the depth cannot be
measured (see `rigid_stiffness`); with the implicit time step it is a stiff potential, so that it takes no energy and gives none
back that was not in it. Friction sticks with the same stiffness and slips at Coulomb's limit (return mapping):

    f_n = k max(0, -g) n,    f_t = the nearest to held - k u_t with |f_t| <= mu |f_n|

The tangent leaves out how a force turns against the sections: on the way to the solution forces are far from it, as in
time_step.py.

u_t: the tangential way of the point over the wall in this step; held: f_t at its beginning. As an implicit penalty method for
rods: D. Tong, A. Choi, J. Joo, M. K. Jawed, "A fully implicit method for robust frictional contact handling in elastic rods",
Extreme Mech. Lett. 58, 2023; the return mapping: P. Wriggers, "Computational Contact Mechanics", 2006, chapter 5.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

_STIFFER = 30.0  # a rigid wall than the stiffest element


class Touching(NamedTuple):
    """Points that can touch, and the forces on them: c at most, of which the first `count[0]` are in use. In the fixed frame.

    slot and row (c,) int: number of the point and of the obstacle's row, by which friction is carried on; section (c,) int: A,
    before the point; weight (c, 2), arm (c, 2, 3) m: of A and B, see surface.py; normal (c, 3): out of the wall; plane (c,) m:
    the gap is normal . x - plane; start (c, 3) m: the place that the point would have if it had stayed where it was on the
    wall; stiffness (c,) N/m; friction (c,); held (c, 3) N: tangential force at the beginning; force (c, 3) N: on the robot; gap
    (c,) m; expected (c, 3) N: the force that the last increment of Newton's method leads to where the point sticks; decided
    (c,) bool: whether there was one; way (c, 3): unit vector along the friction of a point that slips, else 0.
    """

    count: np.ndarray  # type: ignore[assignment]  # tuple has a method of this name
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
    expected: np.ndarray
    decided: np.ndarray
    way: np.ndarray


def touching_of(points: int) -> Touching:
    """Return empty arrays for so many points."""
    c, whole = points, np.int64
    return Touching(
        np.zeros(1, whole), np.zeros(c, whole), np.zeros(c, whole), np.zeros(c, whole), np.zeros((c, 2)), np.zeros((c, 2, 3)),
        np.zeros((c, 3)), np.zeros(c), np.zeros((c, 3)), np.zeros(c), np.zeros(c), np.zeros((c, 3)), np.zeros((c, 3)),
        np.zeros(c), np.zeros((c, 3)), np.zeros(c, bool), np.zeros((c, 3)),
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
    touching: Touching, orientation: np.ndarray, position: np.ndarray, negligible: float, residual: np.ndarray, band: np.ndarray
) -> bool:
    """Subtract the walls' forces from residual (n + 1, 6), and add their tangent to the band; write `touching.force` and `gap`.

    Whether a point touches, sticks or slips is decided by the force that the last increment led to, where there was one: on the
    way to the solution gaps and slips are far larger than at its end. Return whether the forces agree with these decisions, but
    for `negligible` N.
    """
    agrees = True
    x, trial = np.empty(3), np.empty(3)
    for c in range(touching.count[0]):
        a, k, n = touching.section[c], touching.stiffness[c], touching.normal[c]
        force, expected, way = touching.force[c], touching.expected[c], touching.way[c]
        surface_point(orientation, position, a, touching.weight[c, 0], touching.arm[c], x)
        gap = n[0] * x[0] + n[1] * x[1] + n[2] * x[2] - touching.plane[c]
        touching.gap[c] = gap
        push = -k * gap
        along = 0.0
        for i in range(3):
            along += (x[i] - touching.start[c, i]) * n[i]
        size = 0.0
        for i in range(3):
            force[i] = 0.0
            trial[i] = touching.held[c, i] - k * (x[i] - touching.start[c, i] - along * n[i])
            size += trial[i] * trial[i]
        size = math.sqrt(size)
        pressed, mu = push, touching.friction[c]
        if touching.decided[c]:
            pressed = expected[0] * n[0] + expected[1] * n[1] + expected[2] * n[2]
        if pressed <= 0.0:
            agrees = agrees and push <= negligible
            way[0], way[1], way[2] = 0.0, 0.0, 0.0
            continue
        agrees = agrees and push >= -negligible
        drag = 0.0
        for i in range(3):
            if not touching.decided[c]:
                expected[i] = trial[i]
            else:
                expected[i] -= pressed * n[i]
            drag += expected[i] * expected[i]
        drag = math.sqrt(drag)
        limit = mu * pressed
        # A slip that turns round from one iteration to the next has passed the place where it sticks.
        turned = expected[0] * way[0] + expected[1] * way[1] + expected[2] * way[2] < 0.0
        if mu == 0.0:
            way[0], way[1], way[2] = 0.0, 0.0, 0.0
            for i in range(3):
                force[i] = push * n[i]
        elif drag <= limit or turned:
            agrees = agrees and size <= mu * push + negligible
            way[0], way[1], way[2] = 0.0, 0.0, 0.0
            for i in range(3):
                force[i] = push * n[i] + trial[i]
        else:
            along = 0.0
            for i in range(3):
                way[i] = expected[i] / drag
                along += way[i] * trial[i]
            agrees = agrees and along >= mu * push - negligible
            for i in range(3):
                force[i] = push * n[i] + mu * push * way[i] + limit / drag * (trial[i] - along * way[i])
        _add_force(touching, c, orientation, limit / (drag + 1e-300), residual, band)
    return agrees


@njit(cache=True, error_model="numpy")
def _add_force(touching: Touching, c: int, orientation: np.ndarray, part: float, residual: np.ndarray, band: np.ndarray) -> None:
    """Add one point's force to the residual and its tangent to the band; part: of the stiffness, across the way of a slip."""
    k, mu, a = touching.stiffness[c], touching.friction[c], touching.section[c]
    n, way, force = touching.normal[c], touching.way[c], touching.force[c]
    tangent, jacobian, product = np.empty((3, 3)), np.empty((2, 3, 6)), np.empty((3, 6))
    slips = way[0] != 0.0 or way[1] != 0.0 or way[2] != 0.0
    for i in range(3):
        for j in range(3):
            tangent[i, j] = k * n[i] * n[j]
            across = (1.0 if i == j else 0.0) - n[i] * n[j]
            if slips:
                tangent[i, j] += part * k * (across - way[i] * way[j]) + mu * k * way[i] * n[j]
            elif mu > 0.0:
                tangent[i, j] += k * across
    middle = band.shape[1] // 2
    for side in range(2):
        if touching.weight[c, side] == 0.0 or a + side == 0:
            continue
        section_motion(orientation[a + side], touching.weight[c, side], touching.arm[c, side], jacobian[side])
        for j in range(6):
            residual[a + side, j] -= (
                jacobian[side, 0, j] * force[0] + jacobian[side, 1, j] * force[1] + jacobian[side, 2, j] * force[2]
            )
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
            row, first = 6 * (a + side - 1), 6 * (column - side) + middle
            for i in range(6):
                for j in range(6):
                    band[row + i, first + j - i] += (
                        jacobian[side, 0, i] * product[0, j]
                        + jacobian[side, 1, i] * product[1, j]
                        + jacobian[side, 2, i] * product[2, j]
                    )


@njit(cache=True, error_model="numpy")
def expect(touching: Touching, orientation: np.ndarray, position: np.ndarray, increment: np.ndarray) -> None:
    """Write the forces that an increment (6 n,) of the free cross-sections leads to where each point sticks, to `expected`."""
    jacobian, x = np.empty((3, 6)), np.empty(3)
    for c in range(touching.count[0]):
        n, k = touching.normal[c], touching.stiffness[c]
        surface_point(orientation, position, touching.section[c], touching.weight[c, 0], touching.arm[c], x)
        for side in range(2):
            section = touching.section[c] + side
            if touching.weight[c, side] == 0.0 or section == 0:
                continue
            section_motion(orientation[section], touching.weight[c, side], touching.arm[c, side], jacobian)
            for i in range(3):
                for j in range(6):
                    x[i] += jacobian[i, j] * increment[6 * (section - 1) + j]
        gap, along = -touching.plane[c], 0.0
        for i in range(3):
            gap += n[i] * x[i]
            along += n[i] * (x[i] - touching.start[c, i])
        for i in range(3):
            slip = x[i] - touching.start[c, i] - along * n[i]
            touching.expected[c, i] = touching.held[c, i] - k * slip - k * gap * n[i]
        touching.decided[c] = True


@njit(cache=True, error_model="numpy")
def section_motion(r: np.ndarray, weight: float, arm: np.ndarray, out: np.ndarray) -> None:
    """Write how a surface point moves with a section, d x / d eta, to out (3, 6)."""
    for i in range(3):
        for j in range(3):
            out[i, j] = weight * r[i, j]
        out[i, 3] = r[i, 2] * arm[1] - r[i, 1] * arm[2]
        out[i, 4] = r[i, 0] * arm[2] - r[i, 2] * arm[0]
        out[i, 5] = r[i, 1] * arm[0] - r[i, 0] * arm[1]


@njit(cache=True, error_model="numpy")
def difference(known: Touching, found: Touching, orientation: np.ndarray, position: np.ndarray) -> float:
    """Return by how much (m) the points in `found` lie deeper in a wall, or elsewhere to it, than `known` says, at most."""
    worst, deepest, x = 0.0, 0.0, np.empty(3)
    for c in range(known.count[0]):
        deepest = max(deepest, -known.gap[c])
    for c in range(found.count[0]):
        if found.gap[c] >= 0.0:
            continue
        worst = max(worst, -found.gap[c] - deepest)
        for other in range(known.count[0]):
            if known.slot[other] == found.slot[c] and known.row[other] == found.row[c]:
                surface_point(orientation, position, found.section[c], found.weight[c, 0], found.arm[c], x)
                n = known.normal[other]
                worst = max(worst, abs(n[0] * x[0] + n[1] * x[1] + n[2] * x[2] - known.plane[other] - found.gap[c]))
    return worst


@njit(cache=True, error_model="numpy")
def take_over(source: Touching, target: Touching) -> None:
    """Copy the points in use of one to the other; points that were in use there keep what is expected of them."""
    for c in range(source.count[0]):
        for other in range(target.count[0]):
            if target.slot[other] == source.slot[c] and target.row[other] == source.row[c]:
                source.decided[c] = target.decided[other]
                for i in range(3):
                    source.expected[c, i], source.way[c, i] = target.expected[other, i], target.way[other, i]
    target.count[0] = source.count[0]
    for c in range(source.count[0]):
        target.slot[c], target.row[c], target.section[c] = source.slot[c], source.row[c], source.section[c]
        target.plane[c], target.stiffness[c], target.friction[c] = source.plane[c], source.stiffness[c], source.friction[c]
        target.gap[c], target.decided[c] = source.gap[c], source.decided[c]
        for i in range(3):
            target.normal[c, i], target.start[c, i] = source.normal[c, i], source.start[c, i]
            target.held[c, i], target.force[c, i] = source.held[c, i], source.force[c, i]
            target.expected[c, i], target.way[c, i] = source.expected[c, i], source.way[c, i]
            for side in range(2):
                target.weight[c, side] = source.weight[c, side]
                target.arm[c, side, i] = source.arm[c, side, i]


@njit(cache=True, error_model="numpy")
def forget_friction(touching: Touching) -> None:
    """Let all points slide without friction; nothing is expected of them any more."""
    for c in range(touching.count[0]):
        touching.friction[c] = 0.0
        touching.decided[c] = False
        for i in range(3):
            touching.held[c, i] = 0.0
