"""Places of contact in reduced coordinates: how they move with the coordinates, and how forces on them pull; compiled."""

import numpy as np
from numba import njit

from gravcomp.contact.places import Places


@njit(cache=True)
def directions_of(places: Places, change: np.ndarray, rubs: bool, turns: np.ndarray, moves: np.ndarray) -> np.ndarray:
    """Rows (k, r) of `contact.condensed`: normals, both tangents of each place if `rubs`, then those of `turning`."""
    count, r = len(places.row), change.shape[1]
    first = 3 * count if rubs else count
    result = np.zeros((first + len(turns) + len(moves), r))
    for i in range(count):
        for n in range(4):
            share = places.share[i, n]
            if share == 0.0:
                continue
            base = 9 * (places.first[i] + n)
            for j in range(3):
                middle = change[base + j]
                one, two = change[base + 3 + j], change[base + 6 + j]
                x, y = places.own[i]
                for a in range(r):
                    here = share * (middle[a] + x * one[a] + y * two[a])
                    result[i, a] += places.normal[i, j] * here
                    if rubs:
                        result[count + 2 * i, a] += places.around[i, j] * here
                        result[count + 2 * i + 1, a] += places.along[i, j] * here
    for k in range(len(turns)):
        i = turns[k]
        for n in range(4):
            base = 9 * (places.first[i] + n)
            for j in range(3):
                weight = places.share[i, n] * places.around[i, j]
                for a in range(r):
                    result[first + k, a] += weight * change[base + j, a]
    for k in range(len(moves)):
        i = moves[k]
        x, y = places.own[i]
        for n in range(4):
            base = 9 * (places.first[i] + n)
            for j in range(3):
                weight = places.tilt[i, n] * places.normal[i, j]
                for a in range(r):
                    here = change[base + j, a] + x * change[base + 3 + j, a] + y * change[base + 6 + j, a]
                    result[first + len(turns) + k, a] += weight * here
    return result


@njit(cache=True)
def pull_of(places: Places, forces: np.ndarray, change: np.ndarray) -> np.ndarray:
    """Return the force (r,) on the coordinates of forces (c, 3) in N at the places; change (9 s, r) of the stations' sections."""
    at = np.zeros(len(change))
    for i in range(len(places.row)):
        x, y = places.own[i]
        for n in range(4):
            base = 9 * (places.first[i] + n)
            for j in range(3):
                here = places.share[i, n] * forces[i, j]
                at[base + j] += here
                at[base + 3 + j] += x * here
                at[base + 6 + j] += y * here
    return at @ change
