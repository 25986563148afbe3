"""Contact of the rod with the walls of a scene: where it touches them, compiled.

The scene gives the gap of a point to each obstacle (`scene.distance`). Points that can touch are, for every obstacle,

    of each cross-section   the point of its outline that lies farthest towards the wall
    of the last one         five more around its outline, and the point of its face next to the obstacle
    of each element         the point between its cross-sections where the gap is smallest, if that is smaller than at both

Near its present place the wall of each point is taken as a plane with the true gap and normal there; the planes are found again
when the step has converged, until they agree with the wall. Gaps change by no more than the way that a point moves, so that
elements and cross-sections which are farther away than this are left out.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from gravcomp.scene.distance import SceneArrays, gap_to
from gravcomp.virtual.contact_force import Touching, surface_point
from gravcomp.virtual.surface import RodSurface, farthest, inside

_RIM = 5  # more points on the rim of the tip's face, at equal angles
_FACE_POINTS = _RIM + 1  # of the last cross-section, beside the one that it has like all others
_TURN = np.array([[np.cos(k * np.pi / 3), np.sin(k * np.pi / 3)] for k in range(1, _RIM + 1)])
_STAYS = 1e-6  # of the rod's length: the points on the rim of the tip's face move on if others are deeper by so much
_AIMS = 2  # evaluations of the gap until the point of an outline that lies farthest towards the wall is found
_PARTS = 4  # of an element, between which its nearest place is bracketed
_DEEPER = 1e-5  # of the element's length by which a place inside an element lies nearer than its ends
_FLAT = 1e-9  # part of a normal in the section's plane that has no direction


class Walls(NamedTuple):
    """Obstacles of k rows.

    scene: `SceneArrays`, each row in the frame that it belongs to; moving (k,) bool: that of the base, else the fixed one.
    """

    scene: SceneArrays
    moving: np.ndarray


def slots(elements: int) -> int:
    """Return how many points of a rod of `elements` elements can touch one obstacle."""
    return 2 * elements + _FACE_POINTS


@njit(cache=True, error_model="numpy")
def find_contacts(
    walls: Walls,
    surface: RodSurface,
    length: np.ndarray,
    rigid: float,
    reach: float,
    orientation: np.ndarray,
    position: np.ndarray,
    orientation_before: np.ndarray,
    position_before: np.ndarray,
    held: np.ndarray,
    rim: np.ndarray,
    touching: Touching,
) -> None:
    """Fill `touching` with the points whose gap is below `reach` m, at the rod's present pose.

    length (n,) m: of the elements; rigid: stiffness in N/m of a point on a rigid wall; orientation (n + 1, 3, 3),
    position (n + 1, 3) m: of the cross-sections; orientation_before and position_before:
    the rod at the beginning of the step; held (slots, k, 3) N: tangential force then, in the wall's frame; rim (k, 3) m: place
    in the tip's section of its first point on the rim, taken again as long as no other is deeper.
    """
    n = length.shape[0]
    touching.count[0] = 0
    arm, other, normal, x = np.empty((2, 3)), np.empty((2, 3)), np.empty(3), np.empty(3)
    samples, trial = np.empty(_PARTS + 1), np.empty(3)
    for row in range(walls.moving.shape[0]):
        for k in range(1, n + 1):
            for i in range(3):
                x[i] = position[k, i]
            centre = _gap(walls, row, orientation, position, x, normal)
            if centre - surface.size[k] > reach:
                continue
            gap = _rim(walls, row, surface, k, orientation, position, k, arm[0], x, normal)
            arm[1] = 0.0
            if k == n:
                surface_point(orientation, position, n, 1.0, rim[row : row + 1], x)
                before = _gap(walls, row, orientation, position, x, other[0])
                if before < gap + _STAYS * np.sum(length):
                    arm[0], gap = rim[row], before
                    normal[:] = other[0]
                else:
                    surface_point(orientation, position, n, 1.0, arm, x)
                    rim[row] = arm[0]
            share = 0.5 * (length[k - 1] + (length[k] if k < n else 0.0))
            if gap < reach:
                _add(
                    walls, row, k - 1, k, 1.0, arm, gap, normal, x, share, rigid, orientation, position, orientation_before,
                    position_before, held, touching,
                )  # fmt: skip
            if k == n:
                for extra in range(_FACE_POINTS):
                    if extra < _RIM:
                        c, s = _TURN[extra, 0], _TURN[extra, 1]
                        farthest(surface, n, c * arm[0, 0] - s * arm[0, 1], s * arm[0, 0] + c * arm[0, 1], other[0])
                    elif not _facing(walls, row, surface, orientation, position, other[0], x, normal):
                        continue
                    other[1] = 0.0
                    surface_point(orientation, position, n, 1.0, other, x)
                    gap = _gap(walls, row, orientation, position, x, normal)
                    if gap < reach:
                        _add(
                            walls, row, n + extra, n, 1.0, other, gap, normal, x, share, rigid, orientation, position,
                            orientation_before, position_before, held, touching,
                        )  # fmt: skip
        for e in range(n):
            for i in range(3):
                x[i] = 0.5 * (position[e, i] + position[e + 1, i])
            centre = _gap(walls, row, orientation, position, x, normal)
            if centre - max(surface.size[n + 1 + e], surface.size[2 * n + 1 + e]) - 0.6 * length[e] > reach:
                continue
            best = 0
            for p in range(_PARTS + 1):
                samples[p] = _between(
                    walls, row, surface, length, e, p / _PARTS, orientation, position, arm, x, normal
                )  # fmt: skip
                if samples[p] < samples[best]:
                    best = p
            if best == 0 or best == _PARTS:
                continue
            s = best / _PARTS
            bend = samples[best - 1] - 2.0 * samples[best] + samples[best + 1]
            if bend > 0.0:
                s += 0.5 * (samples[best - 1] - samples[best + 1]) / bend / _PARTS
            gap = _between(walls, row, surface, length, e, s, orientation, position, arm, x, trial)
            if gap < samples[best]:
                normal[:] = trial
            else:
                gap = _between(walls, row, surface, length, e, best / _PARTS, orientation, position, arm, x, normal)
                s = best / _PARTS
            if gap < reach and gap < min(samples[0], samples[_PARTS]) - _DEEPER * length[e]:
                _add(
                    walls, row, n + _FACE_POINTS + e, e, 1.0 - _blend(s), arm, gap, normal, x, 0.5 * length[e], rigid,
                    orientation, position, orientation_before, position_before, held, touching,
                )  # fmt: skip


@njit(cache=True, error_model="numpy", inline="always")
def _blend(s: float) -> float:
    """Weight of B in the cubic curve at the share s of the element."""
    return s * s * (3.0 - 2.0 * s)


@njit(cache=True, error_model="numpy")
def _gap(walls: Walls, row: int, orientation: np.ndarray, position: np.ndarray, x: np.ndarray, normal: np.ndarray) -> float:
    """Return the gap of the point x (3,) to a row of the scene and write the wall's normal; both in the fixed frame."""
    if not walls.moving[row]:
        return gap_to(walls.scene, row, x, normal)
    base, origin = orientation[0], position[0]
    own, out = np.empty(3), np.empty(3)
    for i in range(3):
        own[i] = base[0, i] * (x[0] - origin[0]) + base[1, i] * (x[1] - origin[1]) + base[2, i] * (x[2] - origin[2])
    gap = gap_to(walls.scene, row, own, out)
    for i in range(3):
        normal[i] = base[i, 0] * out[0] + base[i, 1] * out[1] + base[i, 2] * out[2]
    return gap


@njit(cache=True, error_model="numpy")
def _towards(surface: RodSurface, outline: int, rotation: np.ndarray, normal: np.ndarray, out: np.ndarray) -> None:
    """Write the point of an outline that lies farthest against the wall's normal, in the section's frame, to out (3,)."""
    u = -(rotation[0, 0] * normal[0] + rotation[1, 0] * normal[1] + rotation[2, 0] * normal[2])
    v = -(rotation[0, 1] * normal[0] + rotation[1, 1] * normal[1] + rotation[2, 1] * normal[2])
    if abs(u) + abs(v) < _FLAT:
        u, v = 1.0, 0.0
    farthest(surface, outline, u, v, out)


@njit(cache=True, error_model="numpy")
def _rim(
    walls: Walls,
    row: int,
    surface: RodSurface,
    outline: int,
    orientation: np.ndarray,
    position: np.ndarray,
    k: int,
    arm: np.ndarray,
    x: np.ndarray,
    normal: np.ndarray,
) -> float:
    """Return the gap at the point of a section's outline next to the wall; write its arm (3,), place and normal.

    normal holds the wall's normal at the middle of the section before.
    """
    gap, r = 0.0, orientation[k]
    for _ in range(_AIMS):
        _towards(surface, outline, r, normal, arm)
        for i in range(3):
            x[i] = position[k, i] + r[i, 0] * arm[0] + r[i, 1] * arm[1] + r[i, 2] * arm[2]
        gap = _gap(walls, row, orientation, position, x, normal)
    return gap


@njit(cache=True, error_model="numpy")
def _facing(
    walls: Walls,
    row: int,
    surface: RodSurface,
    orientation: np.ndarray,
    position: np.ndarray,
    arm: np.ndarray,
    x: np.ndarray,
    normal: np.ndarray,
) -> bool:
    """Write the point of the tip's face that lies next to the wall to arm (3,); return whether it is not on the rim."""
    n = orientation.shape[0] - 1
    r = orientation[n]
    arm[:] = 0.0
    within = False
    for _ in range(_AIMS):
        for i in range(3):
            x[i] = position[n, i] + r[i, 0] * arm[0] + r[i, 1] * arm[1]
        gap = _gap(walls, row, orientation, position, x, normal)
        for i in range(2):
            arm[i] -= gap * (r[0, i] * normal[0] + r[1, i] * normal[1] + r[2, i] * normal[2])
        within = inside(surface, n, arm)
    return within


@njit(cache=True, error_model="numpy")
def _between(
    walls: Walls,
    row: int,
    surface: RodSurface,
    length: np.ndarray,
    e: int,
    s: float,
    orientation: np.ndarray,
    position: np.ndarray,
    arm: np.ndarray,
    x: np.ndarray,
    normal: np.ndarray,
) -> float:
    """Return the gap next to the wall at the share s of an element; write arms (2, 3), place and normal."""
    n = length.shape[0]
    weight = 1.0 - _blend(s)
    along_a, along_b = length[e] * s * (1.0 - s) ** 2, -length[e] * s * s * (1.0 - s)
    arm[:] = 0.0
    arm[0, 2], arm[1, 2] = along_a, along_b
    surface_point(orientation, position, e, weight, arm, x)
    gap = _gap(walls, row, orientation, position, x, normal)
    for _ in range(_AIMS):
        _towards(surface, n + 1 + e, orientation[e], normal, arm[0])
        _towards(surface, 2 * n + 1 + e, orientation[e + 1], normal, arm[1])
        for i in range(2):
            arm[0, i] *= 1.0 - s
            arm[1, i] *= s
        arm[0, 2], arm[1, 2] = along_a, along_b
        surface_point(orientation, position, e, weight, arm, x)
        gap = _gap(walls, row, orientation, position, x, normal)
    return gap


@njit(cache=True, error_model="numpy")
def _add(
    walls: Walls,
    row: int,
    slot: int,
    section: int,
    weight: float,
    arm: np.ndarray,
    gap: float,
    normal: np.ndarray,
    x: np.ndarray,
    share: float,
    rigid: float,
    orientation: np.ndarray,
    position: np.ndarray,
    orientation_before: np.ndarray,
    position_before: np.ndarray,
    held: np.ndarray,
    touching: Touching,
) -> None:
    """Append a point to `touching`; share (m): the length of the robot that it stands for on a wall that yields."""
    c = touching.count[0]
    touching.count[0] += 1
    touching.slot[c], touching.row[c], touching.section[c] = slot, row, section
    touching.weight[c, 0], touching.weight[c, 1] = weight, 1.0 - weight
    touching.stiffness[c] = min(rigid, walls.scene.stiffness[row] * share)
    touching.friction[c] = walls.scene.friction[row]
    surface_point(orientation_before, position_before, section, weight, arm, touching.start[c])
    along, plane = 0.0, -gap
    for i in range(3):
        for side in range(2):
            touching.arm[c, side, i] = arm[side, i]
        touching.normal[c, i] = normal[i]
        plane += normal[i] * x[i]
        touching.held[c, i] = held[slot, row, i]
        touching.force[c, i] = touching.way[c, i] = 0.0
    touching.plane[c], touching.gap[c] = plane, gap
    touching.decided[c] = False
    if walls.moving[row]:
        _carry(orientation_before, position_before, orientation, position, touching.start[c])
        _turn(orientation[0], touching.held[c])
    for i in range(3):
        along += touching.held[c, i] * normal[i]
    for i in range(3):
        touching.held[c, i] -= along * normal[i]


@njit(cache=True, error_model="numpy")
def keep_friction(walls: Walls, orientation: np.ndarray, touching: Touching, held: np.ndarray) -> None:
    """Write the tangential forces at the end of a step to held (slots, k, 3), in the walls' frames; 0 where nothing touches."""
    held[:] = 0.0
    own = np.empty(3)
    for c in range(touching.count[0]):
        along = 0.0
        for i in range(3):
            along += touching.force[c, i] * touching.normal[c, i]
        for i in range(3):
            own[i] = touching.force[c, i] - along * touching.normal[c, i]
        slot, row = touching.slot[c], touching.row[c]
        for i in range(3):
            if walls.moving[row]:
                r = orientation[0]
                held[slot, row, i] = r[0, i] * own[0] + r[1, i] * own[1] + r[2, i] * own[2]
            else:
                held[slot, row, i] = own[i]


@njit(cache=True, error_model="numpy")
def _carry(
    orientation_before: np.ndarray, position_before: np.ndarray, orientation: np.ndarray, position: np.ndarray, x: np.ndarray
) -> None:
    """Move the place x (3,) with the base from its pose at the beginning of the step to that at its end."""
    for i in range(3):
        x[i] -= position_before[0, i]
    own = np.empty(3)
    r = orientation_before[0]
    for i in range(3):
        own[i] = r[0, i] * x[0] + r[1, i] * x[1] + r[2, i] * x[2]
    _turn(orientation[0], own)
    for i in range(3):
        x[i] = position[0, i] + own[i]


@njit(cache=True, error_model="numpy")
def _turn(rotation: np.ndarray, x: np.ndarray) -> None:
    x0, x1, x2 = x[0], x[1], x[2]
    for i in range(3):
        x[i] = rotation[i, 0] * x0 + rotation[i, 1] * x1 + rotation[i, 2] * x2
