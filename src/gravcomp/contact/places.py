"""Places where the robot's surface is near an obstacle; compiled.

At each station the point of the section's outline with the smallest gap g is found (`outline_gap`). Between stations the gap can
be smaller by an eighth of g''. Where that is much and the gap is a minimum along the robot, the place moves there, so that no
point of the surface is deeper in a wall than at these places, within a few micrometres. Whether places move follows from g''
alone: with the slope, a force would hop between a station and the minimum next to it, and no equilibrium would be found.

Where a wall is across the robot, the points on the rim of the tip's face are places too; the nearest one of the rim is one then
only where it is deeper than they are, as in a small tilt.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from gravcomp.contact.outline_gap import ball, deepest, deepest_from
from gravcomp.contact.surface import ContactSurface, size_and_way
from gravcomp.scene.distance import BOX, PLANE, SURFACE, SceneArrays, gap_to

_MOVES, _THERE = 12, 1e-7  # corrections of the place along the robot, and the part of a distance of stations that ends them
_ACROSS = 0.9  # cosine between the axis at the tip and a wall's normal, above which the tip's face can lie on it
_WORTH = 3e-4  # of the radius: places move along the robot where that can make the gap smaller by this


class Places(NamedTuple):
    """c places.

    row (c,): of the obstacle in the scene; station (c,): the nearest one; slot (c,): the station, or, after all of them, the
    point of the rim; first (c,) and share (c, 4): the first of four neighbours, and their weights; own (c, 2): x and y in the
    section, m; gap (c,) in m; normal (c, 3); around (c, 3): tangent in the section; along (c, 3): the other tangent; curvature
    (c,) of the obstacle across the robot in 1/m: change of the normal along `around`, positive next to a ball; tilt (c, 4):
    weights of the four stations for the slope along the robot, a station; rocking (c,): -1 / g'' a station in 1/m, by which
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
        size[s], way[s] = size_and_way(surface, sections, s)
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
                gap[k, s] = deepest_from(scene, k, surface, s, sections[s], middle, own[k, s], normal[k, s])
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
        reach[s] = margin + np.sqrt(moved[s, 0] ** 2 + moved[s, 1] ** 2 + moved[s, 2] ** 2)
    # A force moves from station to station as the robot slides or tilts.
    chosen = np.zeros((rows, stations), dtype=np.bool_)
    for k in range(rows):
        if last[k, stations:].any():
            chosen[k, stations - 1] = True
        for s in range(stations):
            if last[k, s, 0] != 0.0 or last[k, s, 1] != 0.0 or last[k, s, 2] != 0.0:
                chosen[k, max(s - 1, 0) : s + 2] = True
    gap = all_gaps(scene, surface, sections, reach, chosen, own, normal)
    count = np.int64(0)  # no literal: Numba would compile what it is passed to for the literal 0 as well
    for k in range(rows):
        for s in range(stations):
            if gap[k, s] < reach[s] and not chosen[k, s]:
                free = gap[k, s]
                for j in range(3):
                    free += normal[k, s, j] * moved[s, j]
                chosen[k, s] = gap[k, s] < margin or free < margin
            count += chosen[k, s]
    # The tip's face.
    tip, shift = sections[stations - 1], moved[stations - 1]
    axis = _cross((tip[1, 0], tip[1, 1], tip[1, 2]), (tip[2, 0], tip[2, 1], tip[2, 2]))
    least = _ACROSS * _length(axis)
    on_rim, edge, there = np.zeros((rows, rim), dtype=np.bool_), np.empty((rows, rim)), np.empty((rows, rim, 3))
    for k in range(rows):
        if not chosen[k, stations - 1]:
            continue
        there_tip = normal[k, stations - 1]
        if abs(there_tip[0] * axis[0] + there_tip[1] * axis[1] + there_tip[2] * axis[2]) < least:
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
    i = np.int64(0)
    for k in range(rows):
        for s in range(stations):
            if chosen[k, s]:
                _write_place(scene, surface, sections, gap, own, normal, k, s, result, i)
                i += 1
        for n in range(rim):
            if on_rim[k, n]:
                result.row[i], result.station[i], result.slot[i] = k, stations - 1, stations + n
                result.first[i], result.share[i, 3] = stations - 4, 1.0
                _write_frame(scene, surface, tip, surface.rim[n], edge[k, n], there[k, n], 1.0, result, i)
                i += 1
    return result


@njit(cache=True)
def empty_places(count: int) -> Places:
    """Return arrays for `count` places, in which nothing is written yet."""
    return Places(
        np.empty(count, dtype=np.int64), np.empty(count, dtype=np.int64), np.empty(count, dtype=np.int64),
        np.empty(count, dtype=np.int64), np.zeros((count, 4)), np.empty((count, 2)), np.empty(count), np.empty((count, 3)),
        np.empty((count, 3)), np.empty((count, 3)), np.empty(count), np.zeros((count, 4)), np.zeros(count),
    )  # fmt: skip


@njit(cache=True)
def _write_place(
    scene: SceneArrays, surface: ContactSurface, sections: np.ndarray, gap: np.ndarray, own: np.ndarray, normal: np.ndarray,
    k: int, s: int, result: Places, i: int,
) -> None:  # fmt: skip
    """Write place i of the result: that of station s and row k, moved to the minimum along the robot."""
    stations = len(surface.place)
    row, section, share, tilt = result.row, np.empty((3, 3)), result.share[i], result.tilt[i]
    row[i], result.station[i], result.slot[i] = k, s, s
    best, here, there, place = gap[k, s], own[k, s].copy(), normal[k, s].copy(), float(s)
    before, after = gap[k, max(s - 1, 0)], gap[k, min(s + 1, stations - 1)]
    middle = min(max(s, 1), stations - 2)
    bend = gap[k, middle - 1] - 2.0 * gap[k, middle] + gap[k, middle + 1]
    slope = 0.5 * (gap[k, middle + 1] - gap[k, middle - 1]) + (s - middle) * bend
    if best <= before and best <= after and bend > 8.0 * _WORTH * surface.radius[s]:
        end = stations - 1.0
        low, high = max(place - 1.0, 0.0), min(place + 1.0, end)
        falls, rises, gap_low, gap_high = 0.0, 0.0, 0.0, 0.0  # slopes and gaps at both of them, once they are known
        moved, other, across = place - slope / bend, np.empty(2), np.empty(3)
        last, last_ahead, steep = place, 0.0, bend
        for turn in range(_MOVES):
            moved = min(max(moved, low), high)
            first = between(moved, stations, share, tilt)
            _section_at(sections, first, share, section)
            found = deepest(scene, k, surface, s, section, other, across)
            if found < best:
                best, place = found, moved
                here[:], there[:] = other, across
            # The gap's slope along the robot follows from its gradient; its bend is at first that of the stations.
            ahead = 0.0
            for n in range(4):
                of = sections[first + n]
                for j in range(3):
                    ahead += across[j] * tilt[n] * (of[0, j] + other[0] * of[1, j] + other[1] * of[2, j])
            if ahead < 0.0:
                low, falls, gap_low = moved, ahead, found
            else:
                high, rises, gap_high = moved, ahead, found
            if turn and (ahead - last_ahead) * (moved - last) > 0.0:
                steep = (ahead - last_ahead) / (moved - last)
            last, last_ahead = moved, ahead
            moved -= ahead / steep
            if moved >= high and rises == 0.0:  # the minimum may be at the end
                moved = high
            elif moved <= low and falls == 0.0:
                moved = low
            elif not low < moved < high:
                moved = 0.5 * (low + high)
                if falls < 0.0 < rises:  # where both tangents meet: at an edge across the robot that is the place
                    moved = min(max((gap_high - gap_low + falls * low - rises * high) / (falls - rises), low), high)
            if abs(moved - last) < _THERE:
                break
        if 0.0 < min(max(moved, low), high) < end:  # at an end of the robot the place stays when it tilts
            result.rocking[i] = -1.0 / steep
    result.first[i] = between(place, stations, share, tilt)
    _section_at(sections, result.first[i], share, section)
    sharp = scene.kind[k] == BOX or scene.kind[k] == SURFACE
    _write_frame(scene, surface, section, here, best, there, ball(scene.kind[k], surface, s) if sharp else 1.0, result, i)


@njit(cache=True)
def _write_frame(
    scene: SceneArrays, surface: ContactSurface, section: np.ndarray, own: np.ndarray, gap: float, normal: np.ndarray,
    share: float, result: Places, i: int,
) -> None:  # fmt: skip
    """Write gap, normal, tangents and curvature of place i, which is at own (2,) in a section (3, 3).

    share: of the way from the outline to the middle of the section, at which the ball of `outline_gap` has its centre. The normal
    is the one there; at the middle, which is farther off, another part of the obstacle may be nearest.
    """
    result.own[i], result.gap[i], result.normal[i] = own, gap, normal
    write_tangents(section, result, i)
    if scene.kind[result.row[i]] == PLANE:
        result.curvature[i] = 0.0
        return
    h, bend, point, turned = 0.02 * surface.radius[result.station[i]], 0.0, np.empty(3), np.empty(3)
    inside = 0.0  # distance of the ball's centre from the middle, along the normal
    for side in (1.0, -1.0):
        for j in range(3):
            off = (1.0 - share) * (own[0] * section[1, j] + own[1] * section[2, j])
            inside -= 0.5 * off * normal[j]
            point[j] = section[0, j] + off + side * h * result.around[i, j]
        gap_to(scene, result.row[i], point, turned)
        for j in range(3):
            bend += side * turned[j] * result.around[i, j]
    bend = min(max(bend / (2.0 * h), -1.0 / h), 1.0 / h)
    if share < 1.0:  # faces are flat, and edges stand out: nothing bends around the robot
        bend = max(bend, 0.0)
        bend /= 1.0 + bend * max(inside, 0.0)
    result.curvature[i] = bend


@njit(cache=True)
def write_tangents(section: np.ndarray, result: Places, i: int) -> None:
    """Write the tangents of place i, whose normal is known, in a section (3, 3)."""
    normal = (result.normal[i, 0], result.normal[i, 1], result.normal[i, 2])
    one = (section[1, 0], section[1, 1], section[1, 2])
    axis = _cross(one, (section[2, 0], section[2, 1], section[2, 2]))
    around = _cross(axis, normal)
    length = _length(around)
    if length < 1e-6 * _length(axis):  # the wall is across the robot
        out = one[0] * normal[0] + one[1] * normal[1] + one[2] * normal[2]
        around = (one[0] - out * normal[0], one[1] - out * normal[1], one[2] - out * normal[2])
        length = _length(around)
    around = (around[0] / length, around[1] / length, around[2] / length)
    along = _cross(normal, around)
    for j in range(3):
        result.around[i, j], result.along[i, j] = around[j], along[j]


@njit(cache=True)
def _cross(a: tuple[float, float, float], b: tuple[float, float, float]) -> tuple[float, float, float]:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(cache=True)
def between(place: float, stations: int, share: np.ndarray, tilt: np.ndarray) -> int:
    """Write the weights (4,) of four stations for `place`, in distances of stations, and for the slope there; return the first.

    Between two stations the parabolas through either of them and its neighbours are blended linearly (A. Overhauser, 1968): the
    curve is smooth, and where it is between two stations does not depend on the one from which it is looked for.
    """
    one = min(int(place), stations - 2)
    t, first = place - one, min(max(one - 1, 0), stations - 4)
    share[:], tilt[:] = 0.0, 0.0
    part = t if 0 < one < stations - 2 else (1.0 if one == 0 else 0.0)  # of the parabola around the second station
    steeper = 1.0 if 0 < one < stations - 2 else 0.0
    before, here, after = 0.5 * t * (t - 1.0), 1.0 - t * t, 0.5 * t * (t + 1.0)
    own, second, beyond = 0.5 * (t - 1.0) * (t - 2.0), t * (2.0 - t), 0.5 * t * (t - 1.0)
    if one > 0:
        share[one - 1 - first] = (1.0 - part) * before
        tilt[one - 1 - first] = (1.0 - part) * (t - 0.5) - steeper * before
    share[one - first] = (1.0 - part) * here + part * own
    tilt[one - first] = -2.0 * (1.0 - part) * t + part * (t - 1.5) + steeper * (own - here)
    share[one + 1 - first] = (1.0 - part) * after + part * second
    tilt[one + 1 - first] = (1.0 - part) * (t + 0.5) + part * (2.0 - 2.0 * t) + steeper * (second - after)
    if one < stations - 2:
        share[one + 2 - first] = part * beyond
        tilt[one + 2 - first] = part * (t - 0.5) + steeper * beyond
    return first


@njit(cache=True)
def _section_at(sections: np.ndarray, first: int, share: np.ndarray, section: np.ndarray) -> None:
    """Write the section (3, 3) of four stations with the weights (4,)."""
    section[:] = 0.0
    for n in range(4):
        for v in range(3):
            for j in range(3):
                section[v, j] += share[n] * sections[first + n, v, j]


@njit(cache=True)
def _length(vector: tuple[float, float, float]) -> float:
    return np.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)
