"""What presses at places: how far they are off their walls, how they rub, yield and turn, and their forces; compiled."""

from typing import NamedTuple

import numpy as np
from numba import njit

from gravcomp.contact.condensed import SLIDING
from gravcomp.contact.moved_places import positions
from gravcomp.contact.places import Places
from gravcomp.contact.surface import ContactSurface
from gravcomp.scene.distance import SceneArrays, gap_to

_ROUNDING = 1e-15  # of the largest force


class Pressed(NamedTuple):
    """The p places that are pressed.

    row (p,): of the obstacle in the scene; along (p,): m along the robot; position (p, 3) and gap (p,) in m; normal (p, 3);
    force (p, 3) in N; sliding (p,): whether it slides or sticks; by_tension (p, m): change of the normal force by the tensions.
    """

    row: np.ndarray
    along: np.ndarray
    position: np.ndarray
    gap: np.ndarray
    normal: np.ndarray
    force: np.ndarray
    sliding: np.ndarray
    by_tension: np.ndarray


@njit(cache=True)
def pressed_places(
    scene: SceneArrays, surface: ContactSurface, places: Places, forces: np.ndarray, held: np.ndarray, by_tension: np.ndarray,
    sections: np.ndarray,
) -> Pressed:  # fmt: skip
    """Return the places that are pressed by the forces (c, 3), where the stations are now at `sections` (s, 3, 3).

    Of all places: held (c,), states of `condensed`; by_tension (c, m).
    """
    point, normal = positions(places, sections), np.empty(3)
    chosen, count = np.empty(len(point), dtype=np.int64), 0
    for i in range(len(point)):
        if forces[i] @ places.normal[i] > 0.0:
            chosen[count] = i
            count += 1
    chosen = chosen[:count]
    along, gap, position = np.zeros(count), np.empty(count), np.empty((count, 3))
    sliding = held[chosen] == SLIDING
    for k in range(count):
        i = chosen[k]
        for n in range(4):
            along[k] += places.share[i, n] * surface.place[places.first[i] + n]
        position[k] = point[i]
        gap[k] = gap_to(scene, places.row[i], point[i], normal)
    return Pressed(
        places.row[chosen], along, position, gap, places.normal[chosen], forces[chosen], sliding, by_tension[chosen]
    )  # fmt: skip


@njit(cache=True)
def rubbing(
    scene: SceneArrays,
    surface: ContactSurface,
    places: Places,
    start: np.ndarray,
    sections: np.ndarray,
    touched: float,
    pressed: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the coefficients of friction (c,), and how far the places have slid since the last equilibrium (2 c,) in m.

    start and sections (s, 3, 3): then and now. Only places rub that touched then: whose gap was below `touched` radii, or which
    were pressed (k, slots); of those that move along the robot, as on a peg or an edge, also where a neighbour was pressed. The
    motions are along the tangents `around` and `along` of each place.
    """
    before = positions(places, start)
    friction, normal = np.zeros(len(before)), np.empty(3)
    for i in range(len(before)):
        row, slot, station = places.row[i], places.slot[i], places.station[i]
        rubs = pressed[row, slot] or gap_to(scene, row, before[i], normal) < touched * surface.radius[station]
        if places.rocking[i] != 0.0:
            rubs |= pressed[row, max(station - 1, 0)] or pressed[row, min(station + 1, len(surface.place) - 1)]
        if rubs:
            friction[i] = scene.friction[row]
    return friction, slid_by(places, start, sections)


@njit(cache=True)
def slid_by(places: Places, start: np.ndarray, sections: np.ndarray) -> np.ndarray:
    """Return how far in m the places go along both tangents (2 c,) where the stations go from `start` to `sections` (s, 3, 3)."""
    way = positions(places, sections) - positions(places, start)
    slid = np.empty(2 * len(way))
    for i in range(len(way)):
        slid[2 * i], slid[2 * i + 1] = places.around[i] @ way[i], places.along[i] @ way[i]
    return slid


@njit(cache=True)
def yielding(scene: SceneArrays, surface: ContactSurface, places: Places) -> np.ndarray:
    """Return the compliance (c,) of the walls at the places in m/N; 0 where they are rigid."""
    result = np.zeros(len(places.row))
    for i in range(len(result)):
        if np.isfinite(scene.stiffness[places.row[i]]):
            parts = len(surface.rim) if places.slot[i] >= len(surface.place) else 1
            result[i] = parts / (scene.stiffness[places.row[i]] * surface.length[places.station[i]])
    return result


@njit(cache=True)
def forces_at(places: Places, normal: np.ndarray, rub: np.ndarray) -> np.ndarray:
    """Return the forces (c, 3) at the places from those along the normals (c,) and along both tangents (2 c,), or (0,)."""
    result = np.empty((len(normal), 3))
    for i in range(len(normal)):
        for j in range(3):
            result[i, j] = normal[i] * places.normal[i, j]
            if len(rub):
                result[i, j] += rub[2 * i] * places.around[i, j] + rub[2 * i + 1] * places.along[i, j]
    return result


@njit(cache=True)
def remembered(places: Places, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return normal forces (c,) and forces along both tangents (c, 2) of last time; force (k, slots, 3) in N: of `remember`.

    A place that moves along the robot may have been that of the next station.
    """
    count = len(places.row)
    pressed, rub = np.empty(count), np.empty((count, 2))
    for i in range(count):
        row, slot = places.row[i], places.slot[i]
        if places.rocking[i] != 0.0 and not force[row, slot].any():
            slot = slot - 1 if slot > 0 and force[row, slot - 1].any() else slot + 1
        last = force[row, slot]
        pressed[i] = max(places.normal[i] @ last, 0.0)
        rub[i, 0], rub[i, 1] = places.around[i] @ last, places.along[i] @ last
    return pressed, rub


@njit(cache=True)
def remember(places: Places, forces: np.ndarray, force: np.ndarray) -> None:
    """Write the forces (c, 3) of the places to force (k, slots, 3), by obstacle and slot; 0 elsewhere."""
    force[:] = 0.0
    for i in range(len(places.row)):
        force[places.row[i], places.slot[i]] = forces[i]


@njit(cache=True)
def turning(places: Places, pressed: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the places whose forces turn, those whose forces move, and their stiffness D (turns + moves,) in N/m.

    pressed (c,): normal forces in N. The rows are those of the tangents at the middles, then those of the tilts. A force of 0
    does neither, nor does that of a plane turn; one that is rounding error is 0.
    """
    pressed = np.where(pressed > _ROUNDING * max(pressed.max(), 0.0), pressed, 0.0) if len(pressed) else pressed
    stiffness, moving = pressed * places.curvature, pressed * places.rocking
    turns, moves = np.flatnonzero(stiffness), np.flatnonzero(moving)
    return turns, moves, np.concatenate((stiffness[turns], moving[moves]))
