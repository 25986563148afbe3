"""Places that move on with the robot, and keep where they are along it; compiled."""

import numpy as np
from numba import njit

from gravcomp.contact.outline_gap import deepest, deepest_from
from gravcomp.contact.places import Places, write_tangents
from gravcomp.contact.surface import ContactSurface, size_and_way
from gravcomp.scene.distance import SceneArrays, gap_to


@njit(cache=True)
def positions(places: Places, sections: np.ndarray) -> np.ndarray:
    """Return where the material points of the places (c, 3) are for sections (s, 3, 3)."""
    result = np.zeros((len(places.row), 3))
    for i in range(len(places.row)):
        x, y = places.own[i]
        for n in range(4):
            section = sections[places.first[i] + n]
            for j in range(3):
                result[i, j] += places.share[i, n] * (section[0, j] + x * section[1, j] + y * section[2, j])
    return result


@njit(cache=True)
def follow(scene: SceneArrays, surface: ContactSurface, places: Places, sections: np.ndarray) -> None:
    """Write gaps, normals and tangents where the stations are now at `sections` (s, 3, 3).

    Places stay where they are along the robot, and go to the nearest point around it; those of the rim stay.
    """
    section = np.empty((3, 3))
    for i in range(len(places.row)):
        section[:] = 0.0
        for n in range(4):
            share, station = places.share[i, n], places.first[i] + n
            for v in range(3):
                for j in range(3):
                    section[v, j] += share * sections[station, v, j]
        row, station, own, normal = places.row[i], places.station[i], places.own[i], places.normal[i]
        if places.slot[i] < len(surface.place):
            places.gap[i] = deepest(scene, row, surface, station, section, own, normal)
        else:
            places.gap[i] = gap_to(scene, row, section[0] + own[0] * section[1] + own[1] * section[2], normal)
        write_tangents(section, places, i)


@njit(cache=True)
def unseen_depth(scene: SceneArrays, surface: ContactSurface, places: Places, sections: np.ndarray, allowed: float) -> float:
    """Return how deep in m a station at `sections` (s, 3, 3) is that is none of the places, and at least `allowed` m."""
    rows, stations = len(scene.kind), len(surface.place)
    own, normal, seen, deep = np.empty(2), np.empty(3), np.zeros((rows, stations), dtype=np.bool_), allowed
    for i in range(len(places.row)):
        seen[places.row[i], places.station[i]] = True
    for k in range(rows):
        middle = -np.inf  # a bound: a gap changes by no more than the way
        for s in range(stations):
            size, way = size_and_way(surface, sections, s)
            middle -= way
            if seen[k, s] or middle - size > -allowed:
                continue
            middle = gap_to(scene, k, sections[s, 0], normal)
            if middle - size <= -allowed:
                deep = max(deep, -deepest_from(scene, k, surface, s, sections[s], middle, own, normal))
    return deep
