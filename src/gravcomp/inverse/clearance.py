"""Where the robot's surface is near obstacles or zones, and how the tensions change its distance from them.

The backbone between the observed points is the cubic through the four nearest ones. A section is a disc across it, as large as
the robot there; its nearest point is on its edge (`contact.places`), or, next to something that is smaller, within. A tension
moves that point with the middle c of the section and turns it about c: with the tangent t of the backbone, d = t / |t|, the
normal n and the point rho = x - c,

    gap' = n . c' - (n . d) rho . t' / |t|.

The gap has its minima along the robot at any place, not only at a station: a parabola through three stations leads there.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from gravcomp.contact.outline_gap import deepest
from gravcomp.contact.surface import ContactSurface
from gravcomp.scene.distance import SceneArrays, gap_to

_STRETCHES = 8  # parts of the robot; each has one place next to each obstacle
_NODES = 4  # points of the cubic


class Nearby(NamedTuple):
    """k places, the nearest first: row (k,) of the scene; gap (k,) in m; change (k, m) of it in m/N; position (k, 3) in m."""

    row: np.ndarray
    gap: np.ndarray
    change: np.ndarray
    position: np.ndarray


@njit(cache=True)
def nearby(
    scene: SceneArrays, surface: ContactSurface, node: np.ndarray, points: np.ndarray, moved: np.ndarray, within: float, most: int
) -> Nearby:
    """Return at most `most` places that are nearer than `within` m.

    node (n,): m along the robot of the observed points (n, 3), from the base to the tip; moved (n, 3, m): their changes in m/N;
    surface: its sections are round.
    """
    rows, stations, cables = len(scene.kind), len(surface.place), moved.shape[2]
    gaps = np.full((rows, stations), np.inf)
    weight, slope = np.empty(len(node)), np.empty(len(node))
    section, own, normal, tangent = np.empty((3, 3)), np.zeros(2), np.empty(3), np.empty(3)
    for s in range(stations):
        _section(node, points, surface.place[s], weight, slope, section, tangent)
        for k in range(rows):
            if gap_to(scene, k, section[0], normal) - surface.radius[s] < within:
                gaps[k, s] = _to_disc(scene, k, surface, s, section, own, normal)
    row, place, station = _minima(gaps, surface.place, within)
    order = np.empty(len(row))
    position, change = np.empty((len(row), 3)), np.zeros((len(row), cables))
    for i in range(len(row)):
        _section(node, points, place[i], weight, slope, section, tangent)
        order[i] = _to_disc(scene, row[i], surface, station[i], section, own, normal)
        length = np.sqrt(tangent @ tangent)
        offset = own[0] * section[1] + own[1] * section[2]
        turned = (normal @ tangent) / length**2
        position[i] = section[0] + offset
        for n in range(len(node)):
            for j in range(3):
                share = weight[n] * normal[j] - turned * slope[n] * offset[j]
                for a in range(cables):
                    change[i, a] += share * moved[n, j, a]
    chosen = np.argsort(order)[:most]
    return Nearby(row[chosen], order[chosen], change[chosen], position[chosen])


@njit(cache=True)
def _to_disc(
    scene: SceneArrays, row: int, surface: ContactSurface, station: int, section: np.ndarray, own: np.ndarray, normal: np.ndarray
) -> float:
    """Return the smallest gap of a disc; write where it is in the section (2,), and the normal there (3,)."""
    edge, radius, across = deepest(scene, row, surface, station, section, own, normal), surface.radius[station], np.empty(3)
    gap = gap_to(scene, row, section[0], across)
    # The obstacle's point next to the middle, moved into the disc.
    x, y = -gap * (across @ section[1]), -gap * (across @ section[2])
    inward = min(1.0, radius / max(np.sqrt(x * x + y * y), 1e-300))
    x, y = inward * x, inward * y
    gap = gap_to(scene, row, section[0] + x * section[1] + y * section[2], across)
    if gap >= edge:
        return edge
    own[0], own[1] = x, y
    normal[:] = across
    return gap


@njit(cache=True)
def _minima(gaps: np.ndarray, along: np.ndarray, within: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return row, m along the robot and station of the smallest gap (k, s) in each stretch, of those below `within`."""
    rows, stations = gaps.shape
    row, place = np.empty(rows * _STRETCHES, dtype=np.int64), np.empty(rows * _STRETCHES)
    station = np.empty(rows * _STRETCHES, dtype=np.int64)
    count = 0
    for k in range(rows):
        for part in range(_STRETCHES):
            first, last = part * stations // _STRETCHES, (part + 1) * stations // _STRETCHES
            if first == last:
                continue
            s = first + np.argmin(gaps[k, first:last])
            if gaps[k, s] >= within:
                continue
            row[count], place[count], station[count] = k, along[s], s
            if 0 < s < stations - 1:
                before, after = gaps[k, s - 1], gaps[k, s + 1]
                bend = before - 2.0 * gaps[k, s] + after
                if before >= gaps[k, s] <= after and 0.0 < bend < np.inf:
                    place[count] += 0.5 * (before - after) / bend * (along[s] - along[s - 1])
            count += 1
    return row[:count], place[:count], station[:count]


@njit(cache=True)
def _section(
    node: np.ndarray, points: np.ndarray, place: float, weight: np.ndarray, slope: np.ndarray, section: np.ndarray,
    tangent: np.ndarray,
) -> None:  # fmt: skip
    """Write the weights (n,) of the points (n, 3) at `place` m and their slopes (n,) in 1/m, the section p, f_1, f_2, and p'."""
    count = min(_NODES, len(node))
    first = int(min(max(int(np.searchsorted(node, place)) - count // 2, 0), len(node) - count))
    weight[:], slope[:] = 0.0, 0.0
    for i in range(first, first + count):
        value, change = 1.0, 0.0
        for j in range(first, first + count):
            if j != i:
                change = (change * (place - node[j]) + value) / (node[i] - node[j])
                value *= (place - node[j]) / (node[i] - node[j])
        weight[i], slope[i] = value, change
    section[0], tangent[:] = weight @ points, slope @ points
    across = np.zeros(3)
    across[np.argmin(np.abs(tangent))] = 1.0
    one = np.cross(tangent, across)
    section[1] = one / np.sqrt(one @ one)
    section[2] = np.cross(tangent, section[1]) / np.sqrt(tangent @ tangent)
