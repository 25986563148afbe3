"""How far a robot may move before any of its stations comes near an obstacle; compiled.

A gap changes by no more than the way of the point, so that gaps that were looked at once hold for all shapes near by: as long as
no station has gone farther than its gap, less the margin within which contact is looked for, there is no contact.
"""

import numpy as np
from numba import njit

from gravcomp.contact.surface import ContactSurface, size_and_way
from gravcomp.scene.distance import SceneArrays, gap_to

_CORNER = np.sqrt(2.0)  # of the larger half edge of a section: the most by which a corner is from its middle


@njit(cache=True)
def free_way(scene: SceneArrays, surface: ContactSurface, sections: np.ndarray) -> float:
    """Return a lower bound of the smallest gap in m of the stations at `sections` (s, 3, 3): of balls around their outlines."""
    least, normal, corner = np.inf, np.empty(3), _CORNER if surface.outline.shape[1] else 1.0
    for k in range(len(scene.kind)):
        middle = -np.inf
        for s in range(len(sections)):
            size, way = size_and_way(surface, sections, s)
            middle -= way
            if middle - corner * size < least:
                middle = gap_to(scene, k, sections[s, 0], normal)
                least = min(least, middle - corner * size)
    return least


@njit(cache=True)
def farthest_way(surface: ContactSurface, change: np.ndarray, step: np.ndarray) -> float:
    """Return the longest way in m of a point of the stations' outlines, or more, where the coordinates go by `step` (r,).

    change (9 s, r): of the stations' p, f_1, f_2.
    """
    moved, longest = change @ step, 0.0
    for s in range(len(surface.place)):
        square = np.zeros(3)
        for v in range(3):
            for j in range(3):
                square[v] += moved[9 * s + 3 * v + j] ** 2
        way = np.sqrt(square[0]) + surface.radius[s] * (np.sqrt(square[1]) + np.sqrt(square[2]))
        longest = max(longest, way)
    return longest
