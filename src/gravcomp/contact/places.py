"""Places where the robot's surface is near an obstacle; compiled.

At each station the point of the section's outline with the smallest gap g is found. Between stations the gap can be smaller by
an eighth of g''. Where that is much and the gap is a minimum along the robot, the place moves there, so that no point of the
surface is deeper in a wall than at these places, within a few micrometres. Whether places move follows from g'' alone: if it
followed from the slope, a force would hop between a station and the minimum next to it, and no equilibrium would be found.

Where a wall is across the robot, the points on the rim of the tip's face are places too; the nearest one of the rim is one then
only where it is deeper than they are, as in a small tilt.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from gravcomp.contact.surface import ContactSurface
from gravcomp.scene.distance import PLANE, SceneArrays, gap_to

_TURNS = 4  # corrections of the direction in which the outline is nearest
_SETTLED = 1e-5  # of the radius: what it changes of the gap is the square of that
_MOVES = 3  # corrections of the place along the robot
_ACROSS = 0.9  # cosine between the axis at the tip and a wall's normal, above which the tip's face can lie on it
_WORTH = 3e-4  # of the radius: places move along the robot where that can make the gap smaller by this


class Places(NamedTuple):
    """c places.

    row (c,): of the obstacle in the scene; station (c,): the nearest one; slot (c,): the station, or, after all of them, the
    point of the rim; first (c,) and share (c, 3): the first of three neighbours, and their weights; own (c, 2): x and y in the
    section, m; gap (c,) in m; normal (c, 3); around (c, 3): tangent in the section; along (c, 3): the other tangent; curvature
    (c,) of the obstacle across the robot in 1/m: change of the normal along `around`, positive next to a ball; tilt (c, 3):
    weights of the three stations for the slope along the robot, a station; rocking (c,): -1 / g'' a station in 1/m, by which
    the place moves along the robot when it tilts; 0 where it does not.
    """

    row: np.ndarray
    station: np.ndarray
    slot: np.ndarray
    first: np.ndarray
    share: np.ndarray
    own: np.ndarray
    gap: np.ndarray
    normal: np.ndarray
    around: np.ndarray
    along: np.ndarray
    curvature: np.ndarray
    tilt: np.ndarray
    rocking: np.ndarray


@njit(cache=True)
def deepest(
    scene: SceneArrays, row: int, surface: ContactSurface, station: int, section: np.ndarray, own: np.ndarray, normal: np.ndarray
) -> float:
    """Return the smallest gap of a section (3, 3) p, f_1, f_2, and write where it is in the section and the normal there."""
    gap_to(scene, row, section[0], normal)
    return _deepest_from(scene, row, surface, station, section, own, normal)


@njit(cache=True)
def _deepest_from(
    scene: SceneArrays, row: int, surface: ContactSurface, station: int, section: np.ndarray, own: np.ndarray, normal: np.ndarray
) -> float:
    """Do as `deepest`, where the normal at the section's middle is known."""
    corners, radius = surface.outline.shape[1], surface.radius[station]
    point, gap = np.empty(3), np.inf
    for turn in range(_TURNS):
        x = -(normal[0] * section[1, 0] + normal[1] * section[1, 1] + normal[2] * section[1, 2])
        y = -(normal[0] * section[2, 0] + normal[1] * section[2, 1] + normal[2] * section[2, 2])
        before_x, before_y = own[0], own[1]
        if corners == 0:
            length = np.sqrt(x * x + y * y)
            own[0], own[1] = (radius * x / length, radius * y / length) if length > 1e-9 else (radius, 0.0)
        else:
            farthest = -np.inf
            for c in range(corners):
                corner = surface.outline[station, c]
                reach = x * corner[0] + y * corner[1]
                if reach > farthest:
                    farthest = reach
                    own[0], own[1] = corner[0], corner[1]
        if turn and abs(own[0] - before_x) + abs(own[1] - before_y) < _SETTLED * radius:
            break
        for i in range(3):
            point[i] = section[0, i] + own[0] * section[1, i] + own[1] * section[2, i]
        gap = gap_to(scene, row, point, normal)
    return gap


@njit(cache=True)
def all_gaps(
    scene: SceneArrays, surface: ContactSurface, sections: np.ndarray, reach: np.ndarray, asked: np.ndarray, own: np.ndarray,
    normal: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """Return gaps (k, s) of all stations to all rows of the scene for sections (s, 3, 3).

    Stations whose middle is farther than `reach` (s,) from touching have the gap of their middle less their size, or, where no
    neighbour can touch either and they are not `asked` (k, s) for, a lower bound of it: a gap changes by no more than the way
    from one station to the next. Writes own (k, s, 2) and normal (k, s, 3) of the others.
    """
    stations = len(surface.place)
    gap, way, size = np.empty((len(scene.kind), stations)), np.zeros(stations), np.empty(stations)
    for s in range(stations):
        size[s] = max(_length(sections[s, 1]), _length(sections[s, 2])) * surface.radius[s]
        if s:
            way[s] = _length(sections[s, 0] - sections[s - 1, 0])
    far = reach.max() + 2.0 * way.max() + size.max() - size.min()
    for k in range(len(scene.kind)):
        middle = -np.inf
        for s in range(stations):
            middle -= way[s]
            if middle - size[s] > far and not asked[k, s]:
                gap[k, s] = middle - size[s]
                continue
            middle = gap_to(scene, k, sections[s, 0], normal[k, s])
            if middle - size[s] > reach[s]:
                gap[k, s] = middle - size[s]
            else:
                gap[k, s] = _deepest_from(scene, k, surface, s, sections[s], own[k, s], normal[k, s])
    return gap


@njit(cache=True)
def find_places(
    scene: SceneArrays, surface: ContactSurface, sections: np.ndarray, moved: np.ndarray, margin: float, last: np.ndarray
) -> Places:
    """Return the places that touch, or would touch if nothing held the robot.

    sections (s, 3, 3): p, f_1, f_2 of the stations; moved (s, 3): how far p goes in m with the forces of last time; margin:
    places with a smaller gap in m are returned too; last (k, slots, 3): forces of last time.
    """
    rows, stations, rim = len(scene.kind), len(surface.place), len(surface.rim)
    own, normal = np.zeros((rows, stations, 2)), np.zeros((rows, stations, 3))
    reach = np.empty(stations)
    for s in range(stations):
        reach[s] = margin + _length(moved[s])
    # A force moves from station to station as the robot slides or tilts.
    chosen = np.zeros((rows, stations), dtype=np.bool_)
    for k in range(rows):
        if last[k, stations:].any():
            chosen[k, stations - 1] = True
        for s in range(stations):
            if last[k, s, 0] != 0.0 or last[k, s, 1] != 0.0 or last[k, s, 2] != 0.0:
                chosen[k, max(s - 1, 0) : s + 2] = True
    gap = all_gaps(scene, surface, sections, reach, chosen, own, normal)
    count = 0
    for k in range(rows):
        for s in range(stations):
            if gap[k, s] < reach[s] and not chosen[k, s]:
                free = gap[k, s] + normal[k, s] @ moved[s]
                chosen[k, s] = gap[k, s] < margin or free < margin
            count += chosen[k, s]
    # The tip's face.
    tip, shift = sections[stations - 1], moved[stations - 1]
    axis = _cross(tip[1], tip[2])
    least = _ACROSS * _length(axis)
    on_rim, edge, there = np.zeros((rows, rim), dtype=np.bool_), np.empty((rows, rim)), np.empty((rows, rim, 3))
    for k in range(rows):
        if not chosen[k, stations - 1] or abs(normal[k, stations - 1] @ axis) < least:
            continue
        lowest, some = np.inf, False
        for n in range(rim):
            point = tip[0] + surface.rim[n, 0] * tip[1] + surface.rim[n, 1] * tip[2]
            edge[k, n] = gap_to(scene, k, point, there[k, n])
            lowest = min(lowest, edge[k, n])
            free = edge[k, n] + there[k, n] @ shift
            pressed = last[k, stations + n, 0] != 0.0 or last[k, stations + n, 1] != 0.0 or last[k, stations + n, 2] != 0.0
            on_rim[k, n] = pressed or edge[k, n] < margin or free < margin
            some |= on_rim[k, n]
            count += on_rim[k, n]
        if some and gap[k, stations - 1] > lowest - _WORTH * surface.radius[stations - 1]:
            chosen[k, stations - 1] = False
            count -= 1
    result = empty_places(count)
    i = 0
    for k in range(rows):
        for s in range(stations):
            if chosen[k, s]:
                _write_place(scene, surface, sections, gap, own, normal, k, s, result, i)
                i += 1
        for n in range(rim):
            if on_rim[k, n]:
                result.row[i], result.station[i], result.slot[i] = k, stations - 1, stations + n
                result.first[i], result.share[i, 2] = stations - 3, 1.0
                _write_frame(scene, surface, tip, surface.rim[n], edge[k, n], there[k, n], result, i)
                i += 1
    return result


@njit(cache=True)
def empty_places(count: int) -> Places:
    """Return arrays for `count` places, in which nothing is written yet."""
    return Places(
        np.empty(count, dtype=np.int64), np.empty(count, dtype=np.int64), np.empty(count, dtype=np.int64),
        np.empty(count, dtype=np.int64), np.zeros((count, 3)), np.empty((count, 2)), np.empty(count), np.empty((count, 3)),
        np.empty((count, 3)), np.empty((count, 3)), np.empty(count), np.zeros((count, 3)), np.zeros(count),
    )  # fmt: skip


@njit(cache=True)
def _write_place(
    scene: SceneArrays, surface: ContactSurface, sections: np.ndarray, gap: np.ndarray, own: np.ndarray, normal: np.ndarray,
    k: int, s: int, result: Places, i: int,
) -> None:  # fmt: skip
    """Write place i of the result: that of station s and row k, moved to the minimum along the robot."""
    stations = len(surface.place)
    first = min(max(s - 1, 0), stations - 3)
    share, place = result.share[i], float(s - first)
    result.row[i], result.station[i], result.slot[i], result.first[i] = k, s, s, first
    section = sections[s].copy()
    best, here, there = gap[k, s], own[k, s].copy(), normal[k, s].copy()
    before, after = gap[k, max(s - 1, 0)], gap[k, min(s + 1, stations - 1)]
    bend = gap[k, first] - 2.0 * gap[k, first + 1] + gap[k, first + 2]
    slope = 0.5 * (gap[k, first + 2] - gap[k, first]) + (place - 1.0) * bend
    if best <= before and best <= after and bend > 8.0 * _WORTH * surface.radius[s]:
        low, high = max(place - 0.5, 0.0), min(place + 0.5, 2.0)
        moved, other, across = place - slope / bend, np.empty(2), np.empty(3)
        for _ in range(_MOVES):
            moved = min(max(moved, low), high)
            _section_at(sections, first, moved, share, section)
            found = deepest(scene, k, surface, s, section, other, across)
            if found < best:
                best, place = found, moved
                here[:], there[:] = other, across
            # The gap's slope along the robot follows from its gradient; its bend is that of the stations.
            ahead = 0.0
            for j in range(3):
                curve = sections[first + 2, 0, j] - 2.0 * sections[first + 1, 0, j] + sections[first, 0, j]
                ahead += across[j] * (0.5 * (sections[first + 2, 0, j] - sections[first, 0, j]) + (moved - 1.0) * curve)
            moved -= ahead / bend
        if 0.0 < min(max(moved, low), high) < 2.0:  # at an end of the robot the place stays when it tilts
            result.rocking[i] = -1.0 / bend
    _section_at(sections, first, place, share, section)
    tilt = result.tilt[i]
    tilt[0], tilt[1], tilt[2] = place - 1.5, 2.0 - 2.0 * place, place - 0.5
    _write_frame(scene, surface, section, here, best, there, result, i)


@njit(cache=True)
def _write_frame(
    scene: SceneArrays, surface: ContactSurface, section: np.ndarray, own: np.ndarray, gap: float, normal: np.ndarray,
    result: Places, i: int,
) -> None:  # fmt: skip
    """Write gap, normal, tangents and curvature of place i, which is at own (2,) in a section (3, 3)."""
    result.own[i], result.gap[i], result.normal[i] = own, gap, normal
    write_tangents(section, result, i)
    if scene.kind[result.row[i]] == PLANE:
        result.curvature[i] = 0.0
        return
    h, around = 0.02 * surface.radius[result.station[i]], result.around[i]
    one, other = np.empty(3), np.empty(3)
    gap_to(scene, result.row[i], section[0] + h * around, one)
    gap_to(scene, result.row[i], section[0] - h * around, other)
    bend = ((one - other) @ around) / (2.0 * h)
    result.curvature[i] = min(max(bend, -1.0 / h), 1.0 / h)


@njit(cache=True)
def write_tangents(section: np.ndarray, result: Places, i: int) -> None:
    """Write the tangents of place i, whose normal is known, in a section (3, 3)."""
    axis, normal = _cross(section[1], section[2]), result.normal[i]
    around = _cross(axis, normal)
    length = _length(around)
    if length < 1e-6 * _length(axis):  # the wall is across the robot
        around[:] = section[1] - (section[1] @ normal) * normal
        length = _length(around)
    around /= length
    result.around[i], result.along[i] = around, _cross(normal, around)


@njit(cache=True)
def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    result = np.empty(3)
    result[0] = a[1] * b[2] - a[2] * b[1]
    result[1] = a[2] * b[0] - a[0] * b[2]
    result[2] = a[0] * b[1] - a[1] * b[0]
    return result


@njit(cache=True)
def _section_at(sections: np.ndarray, first: int, place: float, share: np.ndarray, section: np.ndarray) -> None:
    """Write the section (3, 3) at `place` (0 to 2) among three stations, and the weights (3,) of these."""
    share[0] = 0.5 * (place - 1.0) * (place - 2.0)
    share[1] = place * (2.0 - place)
    share[2] = 0.5 * place * (place - 1.0)
    for v in range(3):
        for j in range(3):
            section[v, j] = (
                share[0] * sections[first, v, j] + share[1] * sections[first + 1, v, j] + share[2] * sections[first + 2, v, j]
            )


@njit(cache=True)
def _length(vector: np.ndarray) -> float:
    return np.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)
