"""Places where the robot's surface is near another part of the robot; compiled.

The robot is a chain of rounded cones: balls of radius r(t) around the curve y(t) through the middles of its stations. A place of
the part that is farther from the base is a ball around x(s), or a point on the rim of the tip's flat face; the gap is

    g = min over t of |x - y(t)| - r(t) - r(s).

Every pair is looked at once, from its farther part. Each station has a place for each part of the robot that it is near; where
the gap is a minimum along the robot that bends sharply, as where the robot crosses itself, the place moves there (see `places`).
Within a radius of the tip a ball would reach out of its face: there r(s) is that of the section in the direction of the gap,
which is the same for a part that lies alongside. Radii are those of the strained sections, r (|f_1| + |f_2|) / 2.

With the normal n from y to x, w = x - y, d = |w| and P = 1 - n n^T, a displacement changes the gap by n . dw, and to second order
by

    1/2 (dw^T P dw / d - a^T H^-1 a),   a = (n . dx' + x' . P dw / d,  - n . dy' - y' . P dw / d),

where H is the Hessian of |x(s) - y(t)| by those of s and t that are free: places move along the robot. For a point that moves
around the rim of the tip, its angle is in the place of s.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from gravcomp.contact.own_curve import THERE, End, curve_at, distance_bend, end_on_curve, nearest, next_place, radius_at
from gravcomp.contact.own_pairs import known, length_of, moved_before, near_pairs, strained
from gravcomp.contact.own_surface import OwnSurface

_MOVES = 12  # corrections of a place along the robot
_WORTH = 3e-4  # of the radius: as in `places`
_ACROSS = 0.9  # cosine between the axis at the tip and a normal, above which the tip's face can lie on the robot
_BESIDE = 2.5  # stations from a place, between which the other part of its neighbours is sought
_AGAIN = 1e-4  # of a station: two places are the same
_STEEP = 1e-3  # slope of a gap along the robot at its minimum, which is found to rounding
FIXED, MOVED, ROUND, RIM = range(4)  # the first two are balls


class OwnPlaces(NamedTuple):
    """c places; of both parts of the robot, the farther one first.

    kind (c,): FIXED at a station, MOVED along the robot, ROUND: moved around the tip's rim, RIM: fixed on it; slot (c,): station
    of the farther part, or, after all of them, the point of the rim; place (c, 2) in distances of stations; first (c, 2) and
    share (c, 2, 4): first of four stations, and their weights; tilt (c, 2, 4): those for the slope; own (c, 2): point in the
    farther section, m; turn (c, 2): its change with the angle; gap (c,) in m; distance (c,) of the middles, or of point and
    middle; normal (c, 3): toward the farther part; slope (c, 2, 3): x' and y'; bend (c, 3): d^2/ds^2, d^2/ds dt and d^2/dt^2 of
    the distance, 0 for what does not move; swell (c, 2, 2, 3): change of both radii by the sections' f_1 and f_2.
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
    swell: np.ndarray


@njit(cache=True)
def find_own(
    surface: OwnSurface, sections: np.ndarray, moved: np.ndarray, margin: float, pressed: np.ndarray, force: np.ndarray
) -> OwnPlaces:
    """Return the places that touch, or would touch if nothing held the robot.

    sections (n, 3, 3): p, f_1, f_2 of the stations; moved (n, 3): how far p goes in m; margin: places with a smaller gap in m are
    returned too; pressed (l, 2) and force (l,): places (see `OwnPlaces`) and forces of last time.
    """
    n, surface = len(surface.place), strained(surface, sections)
    station, other, count = near_pairs(surface, sections, moved, margin, pressed, force)
    # No literals, here and for `_write`: Numba would compile what they are passed to for each literal as well.
    result, found = empty_own_places(count + len(surface.rim)), np.int64(0)
    far, near, normal = end_on_curve(), end_on_curve(), np.empty(3)
    for k in range(count):
        i, j = station[k], other[k]
        low, high = max(j - 1.0, 0.0), min(j + 1.0, n - 1.0)
        before_too = known(i, j, pressed, force)
        curve_at(sections, float(i), far)
        middle = nearest(surface, sections, far.point, float(j), low, high, near, normal)
        if i == n - 1:
            found = _tip(surface, sections, moved, margin, before_too, far, near, normal, result, found)
            continue
        gap = middle - _far_radius(surface, far, normal)
        if not before_too and gap >= margin and gap + _approach(moved, far, near, normal) >= margin:
            continue
        kind = FIXED
        before, after = _beside(surface, sections, i - 1, near), _beside(surface, sections, i + 1, near)
        sharp = before - 2.0 * gap + after
        lowest = gap <= before and (gap <= after or (i == n - 2 and _rises(surface, sections, near)))
        worth = _WORTH * (0.5 if moved_before(float(i), pressed, force) else 1.0)  # else it would start and stop to move in turn
        if lowest and sharp > 8.0 * worth * surface.radius[i]:
            _cross(surface, sections, i, far, near, normal)
            kind = MOVED
            if found and result.kind[found - 1] == MOVED and _same(result, found - 1, far, near):
                continue  # it was halfway between two stations
        _write(surface, sections, kind, i, (0.0, 0.0), (0.0, 0.0), far, near, normal, result, found)
        found += 1
    return _cut(result, min(found, len(result.kind)))


@njit(cache=True)
def empty_own_places(count: int) -> OwnPlaces:
    """Return arrays for `count` places."""
    whole = np.int64
    return OwnPlaces(
        np.zeros(count, whole), np.zeros(count, whole), np.zeros((count, 2)), np.zeros((count, 2), whole),
        np.zeros((count, 2, 4)), np.zeros((count, 2, 4)), np.zeros((count, 2)), np.zeros((count, 2)), np.zeros(count),
        np.zeros(count), np.zeros((count, 3)),
        np.zeros((count, 2, 3)), np.zeros((count, 3)), np.zeros((count, 2, 2, 3)),
    )  # fmt: skip


@njit(cache=True)
def _cut(places: OwnPlaces, count: int) -> OwnPlaces:
    return OwnPlaces(
        places.kind[:count], places.slot[:count], places.place[:count], places.first[:count], places.share[:count],
        places.tilt[:count], places.own[:count], places.turn[:count], places.gap[:count], places.distance[:count],
        places.normal[:count], places.slope[:count], places.bend[:count], places.swell[:count],
    )  # fmt: skip


@njit(cache=True)
def _beside(surface: OwnSurface, sections: np.ndarray, i: int, near: End) -> float:
    """Return the gap of the ball at station i to the part of the robot about `near`."""
    end, far, normal = end_on_curve(), end_on_curve(), np.empty(3)
    low, high = max(near.place[0] - _BESIDE, 0.0), min(near.place[0] + _BESIDE, len(sections) - 1.0)
    middle = nearest(surface, sections, sections[i, 0], near.place[0], low, high, end, normal)
    curve_at(sections, float(i), far)
    return middle - _far_radius(surface, far, normal)


@njit(cache=True)
def _same(places: OwnPlaces, i: int, far: End, near: End) -> bool:
    """Whether place i is where the ends are."""
    return abs(places.place[i, 0] - far.place[0]) < _AGAIN and abs(places.place[i, 1] - near.place[0]) < _AGAIN


@njit(cache=True)
def _rises(surface: OwnSurface, sections: np.ndarray, near: End) -> bool:
    """Whether the gap of the tip grows along the robot, so that it is smaller before."""
    end, far, normal, tip = end_on_curve(), end_on_curve(), np.empty(3), len(sections) - 1
    low, high = max(near.place[0] - _BESIDE, 0.0), min(near.place[0] + _BESIDE, tip)
    nearest(surface, sections, sections[tip, 0], near.place[0], low, high, end, normal)
    curve_at(sections, float(tip), far)
    return normal[0] * far.slope[0] + normal[1] * far.slope[1] + normal[2] * far.slope[2] > 0.0


@njit(cache=True)
def _far_radius(surface: OwnSurface, far: End, normal: np.ndarray) -> float:
    """Return the radius of the farther part in the direction of the normal: of a ball, but of the section next to the tip."""
    radius, place, n = radius_at(surface, far)[0], far.place[0], len(surface.place)
    if (n - 1.0 - place) * (surface.place[n - 1] - surface.place[n - 2]) >= radius:
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
        distance += radius_at(surface, near)[0]
        ahead = -radius_at(surface, far)[1]
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
    surface: OwnSurface, sections: np.ndarray, moved: np.ndarray, margin: float, asked: bool, far: End, near: End,
    normal: np.ndarray, result: OwnPlaces, found: int,
) -> int:  # fmt: skip
    """Write the places of the tip's face next to the part of the robot about `near`; return the number of places found so far.

    normal (3,): there for the middle of the face.
    """
    n, start = len(surface.place), near.place[0]
    tip, radius = sections[n - 1], math.hypot(surface.rim[0, 0], surface.rim[0, 1])
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
            if asked or gap < margin or gap + _approach(moved, far, near, normal) < margin:
                _write(surface, sections, np.int64(RIM), n + k, (x, y), (0.0, 0.0), far, near, normal, result, found)
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
        distance_bend(far, near, slope, bend, normal, gap + radius_at(surface, near)[0], second)
        ahead = normal[0] * slope[0] + normal[1] * slope[1] + normal[2] * slope[2]
        sharp = second[0] - second[1] ** 2 / second[2] if second[2] > 0.0 else second[0]
        following = next_place(angle, ahead, sharp, bounds)
        if abs(following - angle) < THERE:
            break
        angle = following
    wanted = asked or gap < margin or gap + _approach(moved, far, near, normal) < margin
    if wanted and gap < lowest - _WORTH * radius:
        c, s = radius * math.cos(angle), radius * math.sin(angle)
        _write(surface, sections, np.int64(ROUND), n - 1, (c, s), (-s, c), far, near, normal, result, found)
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
    surface: OwnSurface, sections: np.ndarray, kind: int, slot: int, own: tuple[float, float], turn: tuple[float, float],
    far: End, near: End, normal: np.ndarray, result: OwnPlaces, i: int,
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
    result.gap[i] = distance - radius_at(surface, near)[0]
    if kind <= MOVED:
        result.gap[i] -= _far_radius(surface, far, normal)
    distance_bend(far, near, result.slope[i, 0], bend, normal, distance, result.bend[i])
    # What is no minimum is at an end, or where the radius jumps: it stays there.
    on_near, on_far = -radius_at(surface, near)[1], -radius_at(surface, far)[1]
    for v in range(3):
        on_near -= normal[v] * near.slope[v]
        on_far += normal[v] * far.slope[v]
    if abs(on_near) > _STEEP * length_of(near.slope):
        result.bend[i, 1] = result.bend[i, 2] = 0.0
    if kind == MOVED and abs(on_far) > _STEEP * length_of(far.slope):
        result.bend[i, 0] = result.bend[i, 1] = 0.0
    _swell(surface, sections, near, result.swell[i, 1])
    if kind <= MOVED:
        _swell(surface, sections, far, result.swell[i, 0])


@njit(cache=True)
def _swell(surface: OwnSurface, sections: np.ndarray, end: End, result: np.ndarray) -> None:
    """Write the change (2, 3) of the radius at a place by the section's f_1 and f_2."""
    size = 0.0
    for k in range(2):
        for n in range(4):
            for v in range(3):
                result[k, v] += end.share[n] * sections[end.first[0] + n, 1 + k, v]
        length = length_of(result[k])
        size += 0.5 * length
        for v in range(3):
            result[k, v] /= length
    for k in range(2):
        for v in range(3):
            result[k, v] *= 0.5 * radius_at(surface, end)[0] / size
