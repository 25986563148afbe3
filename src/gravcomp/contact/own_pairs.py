"""Pairs of stations of a robot that come near each other; compiled.

Neighbours are left out: a robot of radius r that bends as sharply as it can without folding into itself, with its axis on a
circle of radius r, closes on itself after half a turn, pi r along its axis. Parts that are nearer along the robot at rest than pi
times the mean of their radii cannot touch otherwise.
"""

import math

import numpy as np
from numba import njit

from gravcomp.contact.own_surface import OwnSurface

_LAST = 1.5, 2.5  # stations by which a place and its other part may differ from those of last time
_PER_STATION = 4  # parts of the robot that a station can be near, on average
_RELATIVE = 0.5  # of their distance: how far two parts may move against each other in one step


@njit(cache=True)
def apart(surface: OwnSurface, i: int, j: int) -> bool:
    """Whether the stations i > j are so far from each other along the robot that they can touch."""
    return surface.place[i] - surface.place[j] > 0.5 * math.pi * (surface.radius[i] + surface.radius[j])


@njit(cache=True)
def may_touch(surface: OwnSurface, sections: np.ndarray, margin: float) -> bool:
    """Whether any part of the robot is nearer to another than `margin` m; sections (n, k, 3): p of the stations first."""
    n, longest = len(surface.place), 0.0
    for i in range(1, n):
        longest = max(longest, distance_of(sections, i, i - 1))
    reach, thickest = margin + longest**2 / (8.0 * surface.radius.min()), surface.radius.max()
    for i in range(1, n):
        j = np.int64(0)  # no literal, as in `find_own`
        while j < n and apart(surface, i, j):
            distance = distance_of(sections, i, j) - surface.radius[i]
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
                part = min(part, _RELATIVE * distance_of(sections, i, j) / math.sqrt(way))
    return part


@njit(cache=True)
def near_pairs(
    surface: OwnSurface, sections: np.ndarray, moved: np.ndarray, margin: float, pressed: np.ndarray, force: np.ndarray
) -> tuple[np.ndarray, np.ndarray, int]:
    """Return pairs of stations, the farther from the base first, whose distance is a minimum for that one, and their number."""
    n = len(surface.place)
    station, other, count = np.empty(_PER_STATION * n, dtype=np.int64), np.empty(_PER_STATION * n, dtype=np.int64), 0
    size, longest, fastest = np.empty(n), 0.0, 0.0
    for i in range(n):
        size[i] = math.sqrt(moved[i, 0] ** 2 + moved[i, 1] ** 2 + moved[i, 2] ** 2)
        fastest = max(fastest, size[i])
        if i:
            longest = max(longest, distance_of(sections, i, i - 1))
    # A gap to the curve is smaller than that to its stations by h^2 / 8 d at most.
    sag, thickest = longest**2 / (8.0 * surface.radius.min()), surface.radius.max()
    for i in range(1, n):
        radius = surface.radius[i]
        reach = margin + size[i] + fastest + sag
        j = np.int64(0)  # no literal, as in `find_own`
        while j < n and apart(surface, i, j):
            distance = distance_of(sections, i, j)
            if distance - radius - surface.radius[j] < reach or known(i, j, pressed, force):
                gap = distance - surface.radius[j]
                lowest = (j == 0 or gap <= distance_of(sections, i, j - 1) - surface.radius[j - 1]) and (
                    gap < distance_of(sections, i, j + 1) - surface.radius[j + 1]
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
def known(i: int, j: int, pressed: np.ndarray, force: np.ndarray) -> bool:
    """Whether something was pressed near the stations i and j last time."""
    found = False
    for k in range(len(force)):
        found |= force[k] > 0.0 and abs(pressed[k, 0] - i) < _LAST[0] and abs(pressed[k, 1] - j) < _LAST[1]
    return found


@njit(cache=True)
def moved_before(place: float, pressed: np.ndarray, force: np.ndarray) -> bool:
    """Whether what was pressed next to a station last time had moved there along the robot."""
    found = False
    for k in range(len(force)):
        found |= force[k] > 0.0 and 0.0 < abs(pressed[k, 0] - place) < 1.0
    return found


@njit(cache=True)
def distance_of(sections: np.ndarray, i: int, j: int) -> float:
    """Return the distance of the middles of two stations."""
    square = 0.0
    for v in range(3):
        square += (sections[i, 0, v] - sections[j, 0, v]) ** 2
    return math.sqrt(square)


@njit(cache=True)
def length_of(vector: np.ndarray) -> float:
    """Return the length of a vector (3,)."""
    return math.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)


@njit(cache=True)
def strained(surface: OwnSurface, sections: np.ndarray) -> OwnSurface:
    """Return the surface with the radii of the strained sections (n, 3, 3)."""
    radius = surface.radius.copy()
    for i in range(len(radius)):
        radius[i] *= 0.5 * (length_of(sections[i, 1]) + length_of(sections[i, 2]))
    return OwnSurface(surface.place, radius, surface.rim)
