"""Places where the robot's surface is near another part of the robot; compiled.

The robot is a chain of rounded cones: balls of radius r(t) around the curve y(t) through the middles of its stations. A place of
the part that is farther from the base is a ball around x(s), or a point on the rim of the tip's flat face; the gap is

    g = min over t of |x - y(t)| - r(t) - r(s).

Every pair is looked at once, from its farther part. Each station has a place for each part of the robot that it is near; where the
gap is a minimum along the robot that bends sharply, as where the robot crosses itself, the place moves there (see `places`).
Within a radius of the tip a ball would reach out of its face: there r(s) is that of the section in the direction of the gap, which
is the same for a part that lies alongside.

Neighbours are left out: a robot of radius r that bends as sharply as it can without folding into itself, with its axis on a circle
of radius r, is around half a turn, pi r along its axis, when parts of it meet that are across that circle. Parts that are nearer
along the robot at rest than pi times the mean of their radii cannot touch otherwise.

With the normal n from y to x, w = x - y, d = |w| and P = 1 - n n^T, a displacement changes the gap by n . dw, and to second order by

    1/2 (dw^T P dw / d - a^T H^-1 a),   a = (n . dx' + x' . P dw / d,  - n . dy' - y' . P dw / d),

where H is the Hessian of |x(s) - y(t)| by those of s and t that are free: places move along the robot. For a point that moves around
the rim of the tip, its angle is in the place of s.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from gravcomp.contact.own_curve import THERE, End, curve_at, distance_bend, end_on_curve, linear, nearest, next_place
from gravcomp.contact.own_surface import OwnSurface

_MOVES = 12  # corrections of a place along the robot
_WORTH = 3e-4  # of the radius: as in `places`
_ACROSS = 0.9  # cosine between the axis at the tip and a normal, above which the tip's face can lie on the robot
_LAST = 1.5, 2.5  # stations by which a place and its other part may differ from those of last time
_PER_STATION = 4  # parts of the robot that a station can be near, on average
_RELATIVE = 0.5  # of their distance: how far two parts may move against each other in one step
FIXED, MOVED, ROUND, RIM = 0, 1, 2, 3


class OwnPlaces(NamedTuple):
    """c places; of both parts of the robot, the farther one first.

    kind (c,): FIXED at a station, MOVED along the robot, ROUND: moved around the tip's rim, RIM: fixed on it; slot (c,): station
    of the farther part, or, after all of them, the point of the rim; place (c, 2) in distances of stations; first (c, 2) and
    share (c, 2, 4): first of four stations, and their weights; tilt (c, 2, 4): those for the slope; own (c, 2): point in the
    farther section, m; turn (c, 2): its change with the angle; gap (c,) in m; distance (c,) of the middles, or of point and middle; normal
    (c, 3): toward the farther part; slope (c, 2, 3): x' and y'; bend (c, 3): d^2/ds^2, d^2/ds dt and d^2/dt^2 of the distance,
    0 for what does not move.
    """

    kind: np.ndarray
    slot: np.ndarray
    place: np.ndarray
    first: np.ndarray
    share: np.ndarray
    tilt: np.ndarray
    own: np.ndarray
    turn: np.ndarray
    gap: np.ndarray
    distance: np.ndarray
    normal: np.ndarray
    slope: np.ndarray
    bend: np.ndarray


@njit(cache=True)
def find_own(
    surface: OwnSurface, sections: np.ndarray, moved: np.ndarray, margin: float, pressed: np.ndarray, force: np.ndarray
) -> OwnPlaces:
    """Return the places that touch, or would touch if nothing held the robot.

    sections (n, 3, 3): p, f_1, f_2 of the stations; moved (n, 3): how far p goes in m; margin: places with a smaller gap in m are
    returned too; pressed (l, 2) and force (l,): places (see `OwnPlaces`) and forces of last time.
    """
    n = len(surface.place)
    station, other, count = _candidates(surface, sections, moved, margin, pressed, force)
    result, found = empty_own_places(count + len(surface.rim)), 0
    far, near, normal = end_on_curve(), end_on_curve(), np.empty(3)
    for k in range(count):
        i, j = station[k], other[k]
        low, high = max(j - 1.0, 0.0), min(j + 1.0, n - 1.0)
        known = _known(i, j, pressed, force)
        curve_at(sections, float(i), far)
        middle = nearest(surface, sections, far.point, float(j), low, high, near, normal)
        if i == n - 1:
            found = _tip(surface, sections, moved, margin, known, far, near, normal, result, found)
            continue
        gap = middle - _far_radius(surface, far, normal)
        if not known and gap >= margin and gap + _approach(moved, far, near, normal) >= margin:
            continue
        kind = FIXED
        before, after = _beside(surface, sections, i - 1, near, low, high), _beside(surface, sections, i + 1, near, low, high)
        sharp = before - 2.0 * gap + after
        lowest = gap <= before and (gap <= after or (i == n - 2 and _rises(sections, near, low, high, surface)))
        if lowest and sharp > 8.0 * _WORTH * surface.radius[i]:
            _cross(surface, sections, i, far, near, normal)
            kind = MOVED
        _write(surface, sections, kind, i, (0.0, 0.0), (0.0, 0.0), far, near, normal, result, found)
        found += 1
    return _cut(result, min(found, len(result.kind)))


@njit(cache=True)
def apart(surface: OwnSurface, i: int, j: int) -> bool:
    """Whether the stations i > j are so far from each other along the robot that they can touch."""
    return surface.place[i] - surface.place[j] > 0.5 * math.pi * (surface.radius[i] + surface.radius[j])


@njit(cache=True)
def may_touch(surface: OwnSurface, sections: np.ndarray, margin: float) -> bool:
    """Whether any part of the robot is nearer to another than `margin` m; sections (n, k, 3): p of the stations first."""
    n, longest = len(surface.place), 0.0
    for i in range(1, n):
        longest = max(longest, _distance(sections, i, i - 1))
    reach, thickest = margin + longest**2 / (8.0 * surface.radius.min()), surface.radius.max()
    for i in range(1, n):
        j = 0
        while j < n and apart(surface, i, j):
            distance = _distance(sections, i, j) - surface.radius[i]
            if distance - surface.radius[j] < reach:
                return True
            j += max(1, int((distance - thickest - reach) / longest))
    return False


@njit(cache=True)
def part_that_passes(surface: OwnSurface, sections: np.ndarray, moved: np.ndarray) -> float:
    """Return the part of a step that moves the middles of sections (n, 3, 3) by moved (n, 3) m, in which none passes another."""
    n, part = len(surface.place), 1.0
    longest = 0.0
    for i in range(n):
        longest = max(longest, moved[i, 0] ** 2 + moved[i, 1] ** 2 + moved[i, 2] ** 2)
    if 2.0 * math.sqrt(longest) < _RELATIVE * surface.radius.min():
        return 1.0
    for i in range(1, n):
        for j in range(n):
            if not apart(surface, i, j):
                break
            way = 0.0
            for v in range(3):
                way += (moved[i, v] - moved[j, v]) ** 2
            if way > 0.0:
                part = min(part, _RELATIVE * _distance(sections, i, j) / math.sqrt(way))
    return part


@njit(cache=True)
def empty_own_places(count: int) -> OwnPlaces:
    """Return arrays for `count` places."""
    whole = np.int64
    return OwnPlaces(
        np.zeros(count, whole), np.zeros(count, whole), np.zeros((count, 2)), np.zeros((count, 2), whole), np.zeros((count, 2, 4)),
        np.zeros((count, 2, 4)), np.zeros((count, 2)), np.zeros((count, 2)), np.zeros(count), np.zeros(count), np.zeros((count, 3)),
        np.zeros((count, 2, 3)), np.zeros((count, 3)),
    )  # fmt: skip


@njit(cache=True)
def _cut(places: OwnPlaces, count: int) -> OwnPlaces:
    return OwnPlaces(
        places.kind[:count], places.slot[:count], places.place[:count], places.first[:count], places.share[:count],
        places.tilt[:count], places.own[:count], places.turn[:count], places.gap[:count], places.distance[:count],
        places.normal[:count], places.slope[:count], places.bend[:count],
    )  # fmt: skip


@njit(cache=True)
def _candidates(
    surface: OwnSurface, sections: np.ndarray, moved: np.ndarray, margin: float, pressed: np.ndarray, force: np.ndarray
) -> tuple[np.ndarray, np.ndarray, int]:
    """Return pairs of stations, farther and nearer to the base, whose distance is a minimum for the farther one, and their number."""
    n = len(surface.place)
    station, other, count = np.empty(_PER_STATION * n, dtype=np.int64), np.empty(_PER_STATION * n, dtype=np.int64), 0
    size, longest, fastest = np.empty(n), 0.0, 0.0
    for i in range(n):
        size[i] = math.sqrt(moved[i, 0] ** 2 + moved[i, 1] ** 2 + moved[i, 2] ** 2)
        fastest = max(fastest, size[i])
        if i:
            longest = max(longest, _distance(sections, i, i - 1))
    # A gap to the curve is smaller than that to its stations by h^2 / 8 d at most.
    sag, thickest = longest**2 / (8.0 * surface.radius.min()), surface.radius.max()
    for i in range(1, n):
        radius = surface.radius[i]
        reach = margin + size[i] + fastest + sag
        j = 0
        while j < n and apart(surface, i, j):
            distance = _distance(sections, i, j)
            if distance - radius - surface.radius[j] < reach or _known(i, j, pressed, force):
                gap = distance - surface.radius[j]
                lowest = (j == 0 or gap <= _distance(sections, i, j - 1) - surface.radius[j - 1]) and (
                    gap < _distance(sections, i, j + 1) - surface.radius[j + 1]
                )
                if lowest and count < len(station):
                    station[count], other[count] = i, j
                    count += 1
                j += 1
            elif len(force):
                j += 1
            else:  # a distance changes by no more than the way from one station to the next
                j += max(1, int((distance - radius - thickest - reach) / longest))
    return station, other, count


@njit(cache=True)
def _known(i: int, j: int, pressed: np.ndarray, force: np.ndarray) -> bool:
    """Whether something was pressed near the stations i and j last time."""
    for k in range(len(force)):
        if force[k] > 0.0 and abs(pressed[k, 0] - i) < _LAST[0] and abs(pressed[k, 1] - j) < _LAST[1]:
            return True
    return False


@njit(cache=True)
def _distance(sections: np.ndarray, i: int, j: int) -> float:
    square = 0.0
    for v in range(3):
        square += (sections[i, 0, v] - sections[j, 0, v]) ** 2
    return math.sqrt(square)


@njit(cache=True)
def _beside(surface: OwnSurface, sections: np.ndarray, i: int, near: End, low: float, high: float) -> float:
    """Return the gap of the ball at station i to the part of the robot about `near`."""
    end, normal = end_on_curve(), np.empty(3)
    middle, far = nearest(surface, sections, sections[i, 0], near.place[0], low, high, end, normal), end_on_curve()
    curve_at(sections, float(i), far)
    return middle - _far_radius(surface, far, normal)


@njit(cache=True)
def _rises(sections: np.ndarray, near: End, low: float, high: float, surface: OwnSurface) -> bool:
    """Whether the gap of the tip grows along the robot, so that it is smaller before."""
    end, far, normal, tip = end_on_curve(), end_on_curve(), np.empty(3), len(sections) - 1
    nearest(surface, sections, sections[tip, 0], near.place[0], low, high, end, normal)
    curve_at(sections, float(tip), far)
    return normal[0] * far.slope[0] + normal[1] * far.slope[1] + normal[2] * far.slope[2] > 0.0


@njit(cache=True)
def _far_radius(surface: OwnSurface, far: End, normal: np.ndarray) -> float:
    """Return the radius of the farther part in the direction of the normal: of a ball, but of the section next to the tip."""
    place = far.place[0]
    radius, _ = linear(surface.radius, place)
    if surface.place[-1] - linear(surface.place, place)[0] >= radius:
        return radius
    along = square = 0.0
    for v in range(3):
        along += normal[v] * far.slope[v]
        square += far.slope[v] ** 2
    return radius * math.sqrt(max(1.0 - along**2 / square, 0.0))


@njit(cache=True)
def _cross(surface: OwnSurface, sections: np.ndarray, i: int, far: End, near: End, normal: np.ndarray) -> None:
    """Move the places, from station i, to where the gap is a minimum along both parts."""
    n = len(surface.place)
    bounds, second, place = np.array([i - 1.0, min(i + 1.0, n - 1.0), 0.0, 0.0]), np.empty(3), float(i)
    for _ in range(_MOVES):
        curve_at(sections, place, far)
        low, high = max(near.place[0] - 1.5, 0.0), min(near.place[0] + 1.5, n - 1.0)
        distance = nearest(surface, sections, far.point, near.place[0], low, high, near, normal)
        distance += linear(surface.radius, near.place[0])[0]
        ahead = -linear(surface.radius, place)[1]
        for v in range(3):
            ahead += normal[v] * far.slope[v]
        distance_bend(far, near, far.slope, far.bend, normal, distance, second)
        steep = second[0] - second[1] ** 2 / second[2] if second[2] > 0.0 and low < near.place[0] < high else second[0]
        following = next_place(place, ahead, steep, bounds)
        if abs(following - place) < THERE:
            break
        place = following


@njit(cache=True)
def _tip(
    surface: OwnSurface, sections: np.ndarray, moved: np.ndarray, margin: float, known: bool, far: End, near: End,
    normal: np.ndarray, result: OwnPlaces, found: int,
) -> int:  # fmt: skip
    """Write the places of the tip's face next to the part of the robot about `near`; return the number of places found so far.

    normal (3,): there for the middle of the face.
    """
    n, start = len(surface.place), near.place[0]
    tip, radius = sections[n - 1], surface.radius[n - 1]
    low, high = max(start - 2.0, 0.0), min(start + 2.0, n - 1.0)
    ahead_x, ahead_y, axis = 0.0, 0.0, np.empty(3)
    for v in range(3):
        axis[v] = tip[1, (v + 1) % 3] * tip[2, (v + 2) % 3] - tip[1, (v + 2) % 3] * tip[2, (v + 1) % 3]
        ahead_x -= normal[v] * tip[1, v]
        ahead_y -= normal[v] * tip[2, v]
    steep = abs(axis[0] * normal[0] + axis[1] * normal[1] + axis[2] * normal[2]) > _ACROSS * math.sqrt((axis**2).sum())
    lowest, point = np.inf, np.empty(3)
    if steep:
        for k in range(len(surface.rim)):
            x, y = surface.rim[k]
            for v in range(3):
                point[v] = tip[0, v] + x * tip[1, v] + y * tip[2, v]
            gap = nearest(surface, sections, point, start, low, high, near, normal)
            if known or gap < margin or gap + _approach(moved, far, near, normal) < margin:
                _write(surface, sections, RIM, n + k, (x, y), (0.0, 0.0), far, near, normal, result, found)
                found, lowest = found + 1, min(lowest, gap)
    # The nearest point of the rim, by its angle.
    angle = math.atan2(ahead_y, ahead_x)
    bounds, bend, second = np.array([angle - 1.6, angle + 1.6, 0.0, 0.0]), np.empty(3), np.empty(3)
    gap, slope = 0.0, np.empty(3)
    for _ in range(_MOVES):
        c, s = radius * math.cos(angle), radius * math.sin(angle)
        for v in range(3):
            bend[v] = -c * tip[1, v] - s * tip[2, v]
            point[v], slope[v] = tip[0, v] - bend[v], c * tip[2, v] - s * tip[1, v]
        gap = nearest(surface, sections, point, near.place[0], low, high, near, normal)
        distance_bend(far, near, slope, bend, normal, gap + linear(surface.radius, near.place[0])[0], second)
        ahead = normal[0] * slope[0] + normal[1] * slope[1] + normal[2] * slope[2]
        sharp = second[0] - second[1] ** 2 / second[2] if second[2] > 0.0 else second[0]
        following = next_place(angle, ahead, sharp, bounds)
        if abs(following - angle) < THERE:
            break
        angle = following
    wanted = known or gap < margin or gap + _approach(moved, far, near, normal) < margin
    if wanted and gap < lowest - _WORTH * radius:
        c, s = radius * math.cos(angle), radius * math.sin(angle)
        _write(surface, sections, ROUND, n - 1, (c, s), (-s, c), far, near, normal, result, found)
        found += 1
    return found


@njit(cache=True)
def _approach(moved: np.ndarray, far: End, near: End, normal: np.ndarray) -> float:
    """Return by how much the gap changes in m where the middles of the stations move by moved (n, 3)."""
    result = 0.0
    for k in range(4):
        for v in range(3):
            result += normal[v] * (far.share[k] * moved[far.first[0] + k, v] - near.share[k] * moved[near.first[0] + k, v])
    return result


@njit(cache=True)
def _write(
    surface: OwnSurface, sections: np.ndarray, kind: int, slot: int, own: tuple[float, float], turn: tuple[float, float], far: End,
    near: End, normal: np.ndarray, result: OwnPlaces, i: int,
) -> None:  # fmt: skip
    """Write place i of the result, where there is room; own and turn: of a point on the rim of the tip."""
    if i >= len(result.kind):
        return
    result.kind[i], result.slot[i] = kind, slot
    result.place[i, 0], result.place[i, 1] = far.place[0], near.place[0]
    result.first[i, 0], result.first[i, 1] = far.first[0], near.first[0]
    result.share[i, 0], result.share[i, 1] = far.share, near.share
    result.tilt[i, 0], result.tilt[i, 1] = far.tilt, near.tilt
    result.normal[i], result.slope[i, 1] = normal, near.slope
    tip, square, bend = sections[len(sections) - 1], 0.0, np.zeros(3)
    for k in range(2):
        result.own[i, k], result.turn[i, k] = own[k], turn[k]
    for v in range(3):
        arm = own[0] * tip[1, v] + own[1] * tip[2, v]
        square += (far.point[v] + arm - near.point[v]) ** 2
        if kind == MOVED:
            result.slope[i, 0, v], bend[v] = far.slope[v], far.bend[v]
        elif kind == ROUND:
            result.slope[i, 0, v], bend[v] = turn[0] * tip[1, v] + turn[1] * tip[2, v], -arm
    distance = result.distance[i] = math.sqrt(square)
    result.gap[i] = distance - linear(surface.radius, near.place[0])[0]
    if kind == FIXED or kind == MOVED:
        result.gap[i] -= _far_radius(surface, far, normal)
    distance_bend(far, near, result.slope[i, 0], bend, normal, distance, result.bend[i])
    if not 0.0 < near.place[0] < len(sections) - 1.0:  # it stays at the end
        result.bend[i, 1] = result.bend[i, 2] = 0.0
