"""The curve through the middles of the stations of a robot, and its nearest place to a point; compiled.

A search for a minimum is Newton's method for where the slope vanishes, kept between places at which the slope has other signs.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from gravcomp.contact.own_surface import OwnSurface
from gravcomp.contact.places import between

_MOVES, THERE = 12, 1e-7  # corrections of a place along the robot, and the part of a distance of stations that ends them
_SAME = 1e-9  # of the radius: a distance is not less, so that there is a direction


class End(NamedTuple):
    """Scratch: a place on the curve through the stations, in distances of stations."""

    place: np.ndarray  # (1,)
    first: np.ndarray  # (1,)
    share: np.ndarray  # (4,)
    tilt: np.ndarray  # (4,)
    point: np.ndarray  # (3,)
    slope: np.ndarray  # (3,)
    bend: np.ndarray  # (3,)


@njit(cache=True)
def end_on_curve() -> End:
    """Return an end in which nothing is written yet."""
    return End(np.zeros(1), np.zeros(1, np.int64), np.zeros(4), np.zeros(4), np.zeros(3), np.zeros(3), np.zeros(3))


@njit(cache=True)
def curve_at(sections: np.ndarray, place: float, end: End) -> None:
    """Write the curve through the middles of the stations at `place`, with its first two derivatives there."""
    n = len(sections)
    end.place[0] = place
    first = end.first[0] = between(place, n, end.share, end.tilt)
    one = min(int(place), n - 2)
    t, a, b = place - one, min(max(one, 1), n - 2), min(max(one + 1, 1), n - 2)
    for v in range(3):
        point = slope = 0.0
        for k in range(4):
            point += end.share[k] * sections[first + k, 0, v]
            slope += end.tilt[k] * sections[first + k, 0, v]
        end.point[v], end.slope[v] = point, slope
        end.bend[v] = (1.0 - t) * (sections[a - 1, 0, v] - 2.0 * sections[a, 0, v] + sections[a + 1, 0, v])
        end.bend[v] += t * (sections[b - 1, 0, v] - 2.0 * sections[b, 0, v] + sections[b + 1, 0, v])


@njit(cache=True)
def radius_at(surface: OwnSurface, end: End) -> tuple[float, float]:
    """Return the radius at an end, between those of the stations as the curve is, and its slope."""
    radius = slope = 0.0
    for k in range(4):
        radius += end.share[k] * surface.radius[end.first[0] + k]
        slope += end.tilt[k] * surface.radius[end.first[0] + k]
    return radius, slope


@njit(cache=True)
def next_place(place: float, ahead: float, steep: float, bounds: np.ndarray) -> float:
    """Return the next place in the search for a minimum, from the gap's slope and bend there.

    bounds (4,): between which it is, then whether the slope is known at either (1) or it is the end of the search (0).
    """
    if ahead > 0.0:
        bounds[1], bounds[3] = place, 1.0
    else:
        bounds[0], bounds[2] = place, 1.0
    following = place - ahead / steep if steep > 0.0 else (bounds[0] if ahead > 0.0 else bounds[1])
    if following <= bounds[0]:
        following = 0.5 * (bounds[0] + place) if bounds[2] and ahead > 0.0 else bounds[0]
    elif following >= bounds[1]:
        following = 0.5 * (bounds[1] + place) if bounds[3] and ahead <= 0.0 else bounds[1]
    return following


@njit(cache=True)
def nearest(
    surface: OwnSurface, sections: np.ndarray, point: np.ndarray, place: float, low: float, high: float, end: End,
    normal: np.ndarray,
) -> float:  # fmt: skip
    """Return the gap of a point (3,) to the robot's surface between the places low and high; write the end and the normal."""
    bounds, gap = np.array([low, high, 0.0, 0.0]), 0.0
    for _ in range(_MOVES):
        curve_at(sections, place, end)
        square = across = along = square_slope = 0.0
        for v in range(3):
            square += (point[v] - end.point[v]) ** 2
        distance = max(math.sqrt(square), _SAME * surface.radius[0])
        for v in range(3):
            normal[v] = (point[v] - end.point[v]) / distance
            along += normal[v] * end.slope[v]
            across += normal[v] * end.bend[v]
            square_slope += end.slope[v] ** 2
        radius, thicker = radius_at(surface, end)
        gap = distance - radius
        following = next_place(place, -along - thicker, (square_slope - along**2) / distance - across, bounds)
        if abs(following - place) < THERE:
            break
        place = following
    return gap


@njit(cache=True)
def distance_bend(
    far: End, near: End, slope: np.ndarray, bend: np.ndarray, normal: np.ndarray, distance: float, out: np.ndarray
) -> None:
    """Write the second derivatives (3,) of the distance of x with `slope` and `bend` from the curve at `near`."""
    out[0] = out[1] = out[2] = 0.0
    x = y = 0.0
    for v in range(3):
        x += normal[v] * slope[v]
        y += normal[v] * near.slope[v]
    for v in range(3):
        out[0] += normal[v] * bend[v] + slope[v] ** 2 / distance
        out[1] -= slope[v] * near.slope[v] / distance
        out[2] += near.slope[v] ** 2 / distance - normal[v] * near.bend[v]
    out[0] -= x * x / distance
    out[1] += x * y / distance
    out[2] -= y * y / distance
