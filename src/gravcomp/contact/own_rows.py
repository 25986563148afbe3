"""Rows of the model for the places where a robot touches itself: what a displacement changes of their gaps; compiled.

The rows hold for the displacements of p, f_1, f_2 of the stations, those of the base left out: (9 s,) numbers. A force in a row
pushes both parts of the robot, equal and opposite. How the forces turn and move with the robot is the second change of the gap
(see `own_places`); it is a quadratic form of four rows, the tangents e_1 . dw and e_2 . dw and the tilts n . dx' and n . dy', and
its principal axes are rows whose forces are independent. Tilts count with the length of the robot as their arm: then the
forces of two parts that cross, which do not turn when these slide, are next to nothing.
"""

import numpy as np
from numba import njit

from gravcomp.contact.own_places import MOVED, ROUND, OwnPlaces

_SMALL = 1e-9  # of the largest stiffness of a place: it is none


@njit(cache=True)
def own_rows(places: OwnPlaces, stations: int) -> np.ndarray:
    """Return the rows (c, 9 s) of the gaps for a robot of s stations after the base."""
    rows = np.zeros((len(places.kind), 9 * stations))
    for i in range(len(rows)):
        _between_parts(places, i, places.normal[i], 1.0, rows[i])
        for end in range(2):
            for k in range(2):
                _add(places.first[i, end], places.share[i, end], 1 + k, places.swell[i, end, k], -1.0, rows[i])
    return rows


@njit(cache=True)
def own_turning(places: OwnPlaces, pressed: np.ndarray, stations: int, length: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the rows (e, 9 s) of forces that turn or move, and their stiffness D (e,) in N/m of `contact.condensed`.

    pressed (c,): forces in N; length of the robot in m.
    """
    count = 0
    for i in range(len(pressed)):
        count += pressed[i] > 0.0
    rows, stiffness, used = np.empty((4 * count, 9 * stations)), np.empty(4 * count), 0
    form, weights, plain = np.empty((4, 4)), np.empty((2, 4)), np.empty((4, 9 * stations))
    for i in range(len(pressed)):
        if not pressed[i] > 0.0:
            continue
        _plain_rows(places, i, length, plain, form, weights)
        size, axes = np.linalg.eigh(form)
        largest = max(abs(size[0]), abs(size[3]))
        for k in range(4):
            if abs(size[k]) > _SMALL * largest:
                rows[used], stiffness[used] = np.ascontiguousarray(axes[:, k]) @ plain, pressed[i] * size[k]
                used += 1
    return rows[:used], stiffness[:used]


@njit(cache=True)
def _plain_rows(places: OwnPlaces, i: int, length: float, rows: np.ndarray, form: np.ndarray, weights: np.ndarray) -> None:
    """Write tangents and tilts (4, 9 s) of place i and the second change of its gap (4, 4) by them; weights (2, 4) is scratch."""
    normal, distance, slope, bend = places.normal[i], places.distance[i], places.slope[i], places.bend[i]
    rows[:], form[:], weights[:] = 0.0, 0.0, 0.0
    along = slope[1] - (slope[1] @ normal) * normal
    size = np.sqrt(along @ along)
    one = along / size
    two = np.array([
        normal[1] * one[2] - normal[2] * one[1], normal[2] * one[0] - normal[0] * one[2], normal[0] * one[1] - normal[1] * one[0]
    ])  # fmt: skip
    _between_parts(places, i, one, 1.0, rows[0])
    _between_parts(places, i, two, 1.0, rows[1])
    form[0, 0] = form[1, 1] = 1.0 / distance
    far_size, near_size = np.sqrt(slope[0] @ slope[0]), np.sqrt(slope[1] @ slope[1])
    free_far, free_near = bend[0] > 0.0 and far_size > 0.0, bend[2] > 0.0
    if free_far and free_near and bend[0] * bend[2] <= bend[1] ** 2:
        free_far = False
    if free_far:
        arm = length / far_size
        if places.kind[i] == MOVED:
            _add(places.first[i, 0], places.tilt[i, 0], 0, normal, arm, rows[2])
        elif places.kind[i] == ROUND:
            for k in range(2):
                _add(places.first[i, 0], places.share[i, 0], 1 + k, normal, arm * places.turn[i, k], rows[2])
        weights[0, 0], weights[0, 1], weights[0, 2] = one @ slope[0] / distance, two @ slope[0] / distance, 1.0 / arm
    if free_near:
        arm = length / near_size
        _add(places.first[i, 1], places.tilt[i, 1], 0, normal, arm, rows[3])
        weights[1, 0], weights[1, 3] = -size / distance, -1.0 / arm
    if free_far and free_near:
        below = bend[0] * bend[2] - bend[1] ** 2
        inverse = bend[2] / below, -bend[1] / below, bend[0] / below
    else:
        inverse = 1.0 / bend[0] if free_far else 0.0, 0.0, 1.0 / bend[2] if free_near else 0.0
    for a in range(4):
        for b in range(4):
            form[a, b] -= inverse[0] * weights[0, a] * weights[0, b] + inverse[2] * weights[1, a] * weights[1, b]
            form[a, b] -= inverse[1] * (weights[0, a] * weights[1, b] + weights[1, a] * weights[0, b])


@njit(cache=True)
def _between_parts(places: OwnPlaces, i: int, direction: np.ndarray, factor: float, row: np.ndarray) -> None:
    """Add direction . dw of place i times a factor to a row (9 s,)."""
    first, share = places.first[i], places.share[i]
    _add(first[0], share[0], 0, direction, factor, row)
    for k in range(2):
        if places.own[i, k] != 0.0:
            _add(first[0], share[0], 1 + k, direction, factor * places.own[i, k], row)
    _add(first[1], share[1], 0, direction, -factor, row)


@njit(cache=True)
def _add(first: int, share: np.ndarray, vector: int, direction: np.ndarray, factor: float, row: np.ndarray) -> None:
    """Add direction . change of p (0), f_1 (1) or f_2 (2) of four stations with the weights (4,), times a factor."""
    for n in range(4):
        station = first + n - 1  # the base has no row
        if station >= 0:
            for j in range(3):
                row[9 * station + 3 * vector + j] += factor * share[n] * direction[j]
