"""Contact of the rod with itself, compiled.

Where two elements come near each other, the places with the smallest gap are found on their axes, and around the rim of the tip's
face. Near them both surfaces are taken as planes across the line between the places, and the two are pushed apart with k times
the depth, equal and opposite (as at walls, contact_force.py). Elements far apart have no room in the band of the tangent; each
pair is a term k G G^T of rank one in Newton's method, as a tendon is, with the gradient G of the gap.

Parts of the rod that are nearer along it than pi times their radius cannot touch: with the axis on a circle of its own radius a
rod closes on itself after half a turn.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from gravcomp.virtual.contact_force import section_motion, surface_point
from gravcomp.virtual.surface import RodSurface, farthest

_GRID = 5  # places of each of two elements from which the nearest two are looked for
_STEPS = 12  # of Newton's method from there
_FINE = 1e-9  # of an element: a step that ends it
_RIM = 6  # points on the rim of the tip's face, at equal angles, the first next to the other part
_AIMS = 3  # evaluations until that is found
_PAIRS = 6  # of elements that touch, for each element


class OwnTouching(NamedTuple):
    """Pairs of places, c at most, of which the first `count[0]` are in use; the place farther from the base first.

    slot (c,) int: number of the pair; section (c, 2) int, weight (c, 2, 2), arm (c, 2, 2, 3) m: of both places, see surface.py;
    normal (c, 3): toward the farther one; apart (c,) m: distance at which they touch; gap (c,) m; force (c,) N; expected (c,) N:
    to which the last increment of Newton's method leads; decided (c,) bool: whether there was one.
    """

    count: np.ndarray  # type: ignore[assignment]  # tuple has a method of this name
    slot: np.ndarray
    section: np.ndarray
    weight: np.ndarray
    arm: np.ndarray
    normal: np.ndarray
    apart: np.ndarray
    gap: np.ndarray
    force: np.ndarray
    expected: np.ndarray
    decided: np.ndarray


def own_touching_of(elements: int) -> OwnTouching:
    """Return empty arrays for a rod of so many elements."""
    c, whole = _PAIRS * elements, np.int64
    return OwnTouching(
        np.zeros(1, whole), np.zeros(c, whole), np.zeros((c, 2), whole), np.zeros((c, 2, 2)), np.zeros((c, 2, 2, 3)),
        np.zeros((c, 3)), np.zeros(c), np.zeros(c), np.zeros(c), np.zeros(c), np.zeros(c, bool),
    )  # fmt: skip


@njit(cache=True, error_model="numpy")
def find_own_contacts(
    surface: RodSurface, length: np.ndarray, reach: float, orientation: np.ndarray, position: np.ndarray, own: OwnTouching
) -> None:
    """Fill `own` with the pairs whose gap is below `reach` m; length (n,) m, orientation (n + 1, 3, 3), position (n + 1, 3) m."""
    n, own.count[0] = length.shape[0], 0
    start, radius = np.zeros(n + 1), np.empty((n, 2))
    for e in range(n):
        start[e + 1] = start[e] + length[e]
        radius[e, 0], radius[e, 1] = surface.size[n + 1 + e], surface.size[2 * n + 1 + e]
    place, arm, x, y, turned = np.empty(2), np.zeros((2, 2, 3)), np.empty(3), np.empty(3), np.empty(3)
    weight = np.empty(2)
    for far in range(1, n):
        for near in range(far):
            widest = max(radius[far, 0], radius[far, 1]), max(radius[near, 0], radius[near, 1])
            square = 0.0
            for i in range(3):
                square += (
                    0.5 * (position[far, i] + position[far + 1, i]) - 0.5 * (position[near, i] + position[near + 1, i])
                ) ** 2
            if math.sqrt(square) - 0.6 * (length[far] + length[near]) - widest[0] - widest[1] > reach:
                continue
            if start[far + 1] - start[near] < 0.5 * math.pi * (widest[0] + widest[1]):
                continue
            gap = _nearest(far, near, start, radius, length, orientation, position, place)
            at_tip = far == n - 1 and place[0] == 1.0  # there the rim touches
            if gap < reach and not at_tip and _can_touch(far, near, place[0], place[1], start, radius, length):
                for side in range(2):
                    arm[side] = 0.0
                    weight[side] = _axis_point(far if side == 0 else near, place[side], length, arm[side])
                surface_point(orientation, position, far, weight[0], arm[0], x)
                surface_point(orientation, position, near, weight[1], arm[1], y)
                apart = _distance(x, y) - gap
                _add(far * n + near, far, near, weight, arm, apart, orientation, position, own)
            if far < n - 1 or not _can_touch(far, near, 1.0, place[1], start, radius, length):
                continue
            t, arm[0] = place[1], 0.0
            for k in range(_RIM):
                if k == 0:
                    surface_point(orientation, position, n - 1, 0.0, arm[0], x)
                    for _ in range(_AIMS):
                        t = _beside(near, x, t, radius, length, orientation, position, y)
                        u = v = 0.0
                        for i in range(3):
                            u += orientation[n, i, 0] * (y[i] - x[i])
                            v += orientation[n, i, 1] * (y[i] - x[i])
                        if abs(u) + abs(v) == 0.0:
                            u = 1.0
                        farthest(surface, n, u, v, arm[0, 1])
                        surface_point(orientation, position, n - 1, 0.0, arm[0], x)
                    turned[:] = arm[0, 1]
                else:
                    c, s = math.cos(2.0 * math.pi * k / _RIM), math.sin(2.0 * math.pi * k / _RIM)
                    farthest(surface, n, c * turned[0] - s * turned[1], s * turned[0] + c * turned[1], arm[0, 1])
                    surface_point(orientation, position, n - 1, 0.0, arm[0], x)
                t = _beside(near, x, t, radius, length, orientation, position, y)
                arm[1] = 0.0
                weight[0], weight[1] = 0.0, _axis_point(near, t, length, arm[1])
                square = 0.0
                for i in range(3):
                    square += (x[i] - y[i]) ** 2
                if math.sqrt(square) - _at(radius[near], t) < reach:
                    _add(n * n + k * n + near, far, near, weight, arm, _at(radius[near], t), orientation, position, own)
                arm[0] = 0.0


@njit(cache=True, error_model="numpy")
def _at(ends: np.ndarray, share: float) -> float:
    return (1.0 - share) * ends[0] + share * ends[1]


@njit(cache=True, error_model="numpy")
def _apart(
    far: int, near: int, s: float, t: float, start: np.ndarray, radius: np.ndarray, x: np.ndarray, y: np.ndarray, dx: np.ndarray
) -> float:  # fmt: skip
    """Return the distance at which places x and y on two axes touch, dx: along the farther one.

    A ball within a radius of the tip would reach out of its face; there it is the section in the direction of the other place.
    """
    size, end = _at(radius[far], s), start[radius.shape[0]] - start[far] - s * (start[far + 1] - start[far])
    if end < size:
        along = square = way = 0.0
        for i in range(3):
            along += dx[i] * (x[i] - y[i])
            square += dx[i] * dx[i]
            way += (x[i] - y[i]) ** 2
        size *= math.sqrt(max(1.0 - along * along / max(square * way, 1e-300), 0.0))
    return size + _at(radius[near], t)


@njit(cache=True, error_model="numpy")
def _can_touch(far: int, near: int, s: float, t: float, start: np.ndarray, radius: np.ndarray, length: np.ndarray) -> bool:
    along = start[far] + s * length[far] - start[near] - t * length[near]
    return along > 0.5 * math.pi * (_at(radius[far], s) + _at(radius[near], t))


@njit(cache=True, error_model="numpy")
def _axis_point(element: int, s: float, length: np.ndarray, arm: np.ndarray) -> float:
    """Write the arms (2, 3) of the place at the share s of an element's bent axis; return the weight of its first section."""
    arm[0, 2], arm[1, 2] = length[element] * s * (1.0 - s) ** 2, -length[element] * s * s * (1.0 - s)
    return 1.0 - s * s * (3.0 - 2.0 * s)


@njit(cache=True, error_model="numpy")
def _axis(
    element: int, s: float, length: np.ndarray, orientation: np.ndarray, position: np.ndarray, x: np.ndarray, along: np.ndarray
) -> None:
    """Write the place on an element's bent axis and how it changes with the share s."""
    blend, steep = s * s * (3.0 - 2.0 * s), 6.0 * s * (1.0 - s)
    a, b = length[element] * s * (1.0 - s) ** 2, -length[element] * s * s * (1.0 - s)
    slope_a, slope_b = length[element] * (1.0 - s) * (1.0 - 3.0 * s), length[element] * s * (3.0 * s - 2.0)
    for i in range(3):
        first, second = orientation[element, i, 2], orientation[element + 1, i, 2]
        way = position[element + 1, i] - position[element, i]
        x[i] = position[element, i] + blend * way + a * first + b * second
        along[i] = steep * way + slope_a * first + slope_b * second


@njit(cache=True, error_model="numpy")
def _nearest(
    far: int, near: int, start: np.ndarray, radius: np.ndarray, length: np.ndarray, orientation: np.ndarray, position: np.ndarray,
    place: np.ndarray,
) -> float:  # fmt: skip
    """Return the smallest gap of two elements; write the shares (2,) of both at which it is.

    Projected Gauss-Newton steps on the square of the distance from the best of a grid.
    """
    x, y, dx, dy = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    best = np.inf
    for i in range(_GRID):
        for j in range(_GRID):
            s, t = i / (_GRID - 1.0), j / (_GRID - 1.0)
            _axis(far, s, length, orientation, position, x, dx)
            _axis(near, t, length, orientation, position, y, dy)
            gap = _distance(x, y) - _apart(far, near, s, t, start, radius, x, y, dx)
            if gap < best:
                best, place[0], place[1] = gap, s, t
    s, t = place[0], place[1]
    for _ in range(_STEPS):
        _axis(far, s, length, orientation, position, x, dx)
        _axis(near, t, length, orientation, position, y, dy)
        a = b = c = f = g = 0.0
        for i in range(3):
            w = x[i] - y[i]
            a += dx[i] * dx[i]
            b -= dx[i] * dy[i]
            c += dy[i] * dy[i]
            f += w * dx[i]
            g -= w * dy[i]
        a, c = a * 1.001, c * 1.001  # parallel elements are near each other all along
        below = a * c - b * b
        new_s, new_t = s - (c * f - b * g) / below, t - (a * g - b * f) / below
        if new_s < 0.0 or new_s > 1.0:
            new_s = min(max(new_s, 0.0), 1.0)
            new_t = t - (g + b * (new_s - s)) / c
        if new_t < 0.0 or new_t > 1.0:
            new_t = min(max(new_t, 0.0), 1.0)
            new_s = min(max(s - (f + b * (new_t - t)) / a, 0.0), 1.0)
        moved = abs(new_s - s) + abs(new_t - t)
        s, t = new_s, new_t
        if moved < _FINE:
            break
    _axis(far, s, length, orientation, position, x, dx)
    _axis(near, t, length, orientation, position, y, dy)
    gap = _distance(x, y) - _apart(far, near, s, t, start, radius, x, y, dx)
    if gap < best:
        best, place[0], place[1] = gap, s, t
    return best


@njit(cache=True, error_model="numpy")
def _beside(
    near: int, x: np.ndarray, t: float, radius: np.ndarray, length: np.ndarray, orientation: np.ndarray, position: np.ndarray,
    y: np.ndarray,
) -> float:  # fmt: skip
    """Return the share of an element at which its axis is next to the place x (3,), sought from t; write the place there."""
    dy = np.empty(3)
    for _ in range(_STEPS):
        _axis(near, t, length, orientation, position, y, dy)
        ahead = square = 0.0
        for i in range(3):
            ahead += (x[i] - y[i]) * dy[i]
            square += dy[i] * dy[i]
        moved = min(max(t + ahead / square, 0.0), 1.0) - t
        t += moved
        if abs(moved) < _FINE:
            break
    _axis(near, t, length, orientation, position, y, dy)
    return t


@njit(cache=True, error_model="numpy")
def _distance(x: np.ndarray, y: np.ndarray) -> float:
    return math.sqrt((x[0] - y[0]) ** 2 + (x[1] - y[1]) ** 2 + (x[2] - y[2]) ** 2)


@njit(cache=True, error_model="numpy")
def _add(
    slot: int, far: int, near: int, weight: np.ndarray, arm: np.ndarray, apart: float, orientation: np.ndarray,
    position: np.ndarray, own: OwnTouching,
) -> None:  # fmt: skip
    """Append a pair, where there is room."""
    c = own.count[0]
    if c == len(own.slot):
        return
    own.count[0] += 1
    x, y = np.empty(3), np.empty(3)
    own.slot[c], own.section[c, 0], own.section[c, 1] = slot, far, near
    for side in range(2):
        own.weight[c, side, 0], own.weight[c, side, 1] = weight[side], 1.0 - weight[side]
        own.arm[c, side] = arm[side]
    surface_point(orientation, position, far, weight[0], arm[0], x)
    surface_point(orientation, position, near, weight[1], arm[1], y)
    distance = max(_distance(x, y), 1e-12)
    for i in range(3):
        own.normal[c, i] = (x[i] - y[i]) / distance
    own.apart[c], own.gap[c], own.force[c], own.decided[c] = apart, distance - apart, 0.0, False


@njit(cache=True, error_model="numpy")
def own_gap(own: OwnTouching, c: int, orientation: np.ndarray, position: np.ndarray) -> float:
    """Return the gap in m of pair c, along its normal, at a pose of the rod."""
    x, y, gap = np.empty(3), np.empty(3), -own.apart[c]
    surface_point(orientation, position, own.section[c, 0], own.weight[c, 0, 0], own.arm[c, 0], x)
    surface_point(orientation, position, own.section[c, 1], own.weight[c, 1, 0], own.arm[c, 1], y)
    for i in range(3):
        gap += own.normal[c, i] * (x[i] - y[i])
    return gap


@njit(cache=True, error_model="numpy")
def add_own_contacts(
    own: OwnTouching, rigid: float, negligible: float, orientation: np.ndarray, position: np.ndarray, residual: np.ndarray,
    gradient: np.ndarray, spring: np.ndarray,
) -> bool:  # fmt: skip
    """Subtract the forces of the pairs from residual (n + 1, 6); write gaps, forces, gradients (6 n, c) and spring (c,) N/m.

    rigid: stiffness in N/m. Whether two places touch is decided by the force that the last increment led to, where there was one.
    Return whether the forces agree with these decisions, but for `negligible` N.
    """
    agrees, jacobian = True, np.empty((3, 6))
    gradient[:], spring[:] = 0.0, 0.0
    for c in range(own.count[0]):
        own.gap[c] = own_gap(own, c, orientation, position)
        push = -rigid * own.gap[c]
        touches = own.expected[c] > 0.0 if own.decided[c] else push > 0.0
        agrees = agrees and (push >= -negligible if touches else push <= negligible)
        own.force[c], spring[c] = (push, rigid) if touches else (0.0, 0.0)
        for end in range(2):
            for side in range(2):
                section = own.section[c, end] + side
                if section == 0 or (own.weight[c, end, side] == 0.0 and not own.arm[c, end, side].any()):
                    continue
                section_motion(orientation[section], own.weight[c, end, side], own.arm[c, end, side], jacobian)
                sign = 1.0 if end == 0 else -1.0
                for j in range(6):
                    along = 0.0
                    for i in range(3):
                        along += sign * own.normal[c, i] * jacobian[i, j]
                    gradient[6 * (section - 1) + j, c] += along
                    residual[section, j] -= own.force[c] * along
    return agrees


@njit(cache=True, error_model="numpy")
def expect_own(own: OwnTouching, rigid: float, gradient: np.ndarray, increment: np.ndarray) -> None:
    """Write the forces that an increment (6 n,) leads to; gradient (6 n, c): of `add_own_contacts`."""
    for c in range(own.count[0]):
        gap = own.gap[c]
        for k in range(len(increment)):
            gap += gradient[k, c] * increment[k]
        own.expected[c], own.decided[c] = -rigid * gap, True


@njit(cache=True, error_model="numpy")
def own_difference(known: OwnTouching, found: OwnTouching, orientation: np.ndarray, position: np.ndarray) -> float:
    """Return by how much (m) the pairs in `found` are deeper than `known` says, or elsewhere, at most."""
    worst, deepest = 0.0, 0.0
    for c in range(known.count[0]):
        deepest = max(deepest, -known.gap[c])
    for c in range(found.count[0]):
        if found.gap[c] >= 0.0:
            continue
        worst = max(worst, -found.gap[c] - deepest)
        for other in range(known.count[0]):
            if known.slot[other] == found.slot[c]:
                worst = max(worst, abs(own_gap(known, other, orientation, position) - found.gap[c]))
    return worst


@njit(cache=True, error_model="numpy")
def take_own_over(source: OwnTouching, target: OwnTouching) -> None:
    """Copy the pairs in use of one to the other; those in use there keep what is expected of them."""
    for c in range(source.count[0]):
        for other in range(target.count[0]):
            if target.slot[other] == source.slot[c]:
                source.decided[c], source.expected[c] = target.decided[other], target.expected[other]
    target.count[0] = source.count[0]
    for c in range(source.count[0]):
        target.slot[c], target.section[c], target.weight[c], target.arm[c] = (
            source.slot[c], source.section[c], source.weight[c], source.arm[c]
        )  # fmt: skip
        target.normal[c], target.apart[c], target.gap[c] = source.normal[c], source.apart[c], source.gap[c]
        target.force[c], target.expected[c], target.decided[c] = source.force[c], source.expected[c], source.decided[c]
