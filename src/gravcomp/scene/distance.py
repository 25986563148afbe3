"""Signed distances from points to the obstacles of a scene; compiled, because they are asked for in every step of a model.

The gap is positive in free space and negative inside an obstacle; its gradient is the unit normal out of the obstacle. A tube is
the envelope of the balls of radius r(t) around its centre line c(t): with

    F(x) = max over t of r(t) - |x - c(t)|,

F is the exact distance to its wall for a point inside, and -F for one outside, as long as the maximum is unique. The gap of the
surface from a file is in `surface_distance`.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from gravcomp.scene.surface_distance import SurfaceArrays, surface_gap

PLANE, SPHERE, BOX, TUBE, SURFACE = range(5)

_NEWTON_STEPS = 30
_SAME = 1e-9  # of a distance: the nearest edge or corner is that of faces of several groups, but for rounding
_EXACT = 1e-7  # of a piece of a curve: after a step of Newton's method that is shorter, the next one would be rounding error


class SceneArrays(NamedTuple):
    """Obstacles in `soft_base`, SI.

    obstacle (k,): its number in the scene (a hollow cuboid is six planes of one number, a surface with hollow edges some groups
    of faces); kind (k,); rotation (k, 3, 3) and origin
    (k, 3): x = rotation y + origin for y in the obstacle's own frame; size (k, 3): half edges of a cuboid, or the radius; sign
    (k,): 1 where the robot is outside, -1 inside; first and last (k,): its curve pieces, or the roots of
    its faces and, where these are a group, of the whole surface, else -1; closed (k,): as in `TubeWall`;
    stiffness (k,) in Pa, infinite: rigid; friction (k,). curve (c, 4, 4): coefficients of x, y, z, radius (columns) of each
    piece by descending powers of the place in it, 0 to 1; samples (c, s, 4): x, y, z, radius at s places of each piece;
    surface: `SurfaceArrays` of all meshes.
    """

    obstacle: np.ndarray
    kind: np.ndarray
    rotation: np.ndarray
    origin: np.ndarray
    size: np.ndarray
    sign: np.ndarray
    first: np.ndarray
    last: np.ndarray
    closed: np.ndarray
    stiffness: np.ndarray
    friction: np.ndarray
    curve: np.ndarray
    samples: np.ndarray
    surface: SurfaceArrays


@njit(cache=True)
def nearest(scene: SceneArrays, point: np.ndarray, normal: np.ndarray) -> tuple[float, int]:
    """Return the smallest gap (m) at a point (3,) and its row, and write the normal (3,); inf, -1 in an empty scene."""
    best, row = np.inf, -1
    other = np.zeros(3)
    normal[:] = 0.0
    for k in range(len(scene.kind)):
        gap = gap_to(scene, k, point, other)
        if gap < best:
            best, row = gap, k
            normal[:] = other
    return best, row


@njit(cache=True, inline="always")
def gap_to(scene: SceneArrays, k: int, point: np.ndarray, normal: np.ndarray) -> float:
    """Return the gap in m between a point (3,) and row k of `scene`, and write its normal (3,), a unit vector into free space."""
    r = scene.rotation[k]
    x, y, z = point[0] - scene.origin[k, 0], point[1] - scene.origin[k, 1], point[2] - scene.origin[k, 2]
    kind = scene.kind[k]
    if kind == PLANE:
        for i in range(3):
            normal[i] = r[i, 2]
        return r[0, 2] * x + r[1, 2] * y + r[2, 2] * z
    # In the obstacle's own frame; no arrays, which would take longer than the distance.
    own_x = r[0, 0] * x + r[1, 0] * y + r[2, 0] * z
    own_y = r[0, 1] * x + r[1, 1] * y + r[2, 1] * z
    own_z = r[0, 2] * x + r[1, 2] * y + r[2, 2] * z
    if kind == SPHERE:
        gap = scene.sign[k] * (_from_centre(own_x, own_y, own_z, normal, scene.sign[k]) - scene.size[k, 0])
    elif kind == BOX:
        gap = _box(own_x, own_y, own_z, scene.size[k], normal)
    elif kind == TUBE:
        gap = _tube(
            scene.curve, scene.samples, scene.first[k], scene.last[k], scene.sign[k], scene.closed[k], own_x, own_y, own_z, normal
        )
    else:
        gap = _surface(scene, k, np.array([own_x, own_y, own_z]), normal)
    here_x, here_y, here_z = normal[0], normal[1], normal[2]
    for i in range(3):
        normal[i] = r[i, 0] * here_x + r[i, 1] * here_y + r[i, 2] * here_z
    return gap


@njit(cache=True)
def _surface(scene: SceneArrays, k: int, point: np.ndarray, normal: np.ndarray) -> float:
    """Return the gap to a surface, or to a group of its faces.

    A group is open: what is behind it is in the wall only where no other face is nearer.
    """
    gap, side = scene.sign[k] * surface_gap(scene.surface, scene.first[k], point, normal), scene.sign[k]
    if gap < 0.0 and scene.last[k] >= 0:
        whole = scene.sign[k] * surface_gap(scene.surface, scene.last[k], point, np.empty(3))
        if gap < whole - _SAME * abs(whole):
            gap, side = -gap, -side
    for i in range(3):
        normal[i] *= side
    return gap


@njit(cache=True)
def _from_centre(x: float, y: float, z: float, normal: np.ndarray, sign: float) -> float:
    """Return the distance (m) from the origin, and write sign times the direction from there; any direction at the origin."""
    length = np.sqrt(x * x + y * y + z * z)
    if length > 0.0:
        normal[0], normal[1], normal[2] = sign * x / length, sign * y / length, sign * z / length
    else:
        normal[0], normal[1], normal[2] = 1.0, 0.0, 0.0
    return length


@njit(cache=True)
def _box(x: float, y: float, z: float, half: np.ndarray, normal: np.ndarray) -> float:
    """Return the gap to a solid cuboid."""
    outside, deepest, face, own = 0.0, -np.inf, 0, (x, y, z)
    for i in range(3):
        beyond = abs(own[i]) - half[i]
        normal[i] = max(beyond, 0.0) * (1.0 if own[i] >= 0.0 else -1.0)
        outside += normal[i] ** 2
        if beyond > deepest:
            deepest, face = beyond, i
    if outside > 0.0:
        length = np.sqrt(outside)
        for i in range(3):
            normal[i] /= length
        return length
    normal[:] = 0.0
    normal[face] = 1.0 if own[face] >= 0.0 else -1.0
    return deepest


@njit(cache=True)
def _tube(
    curve: np.ndarray, samples: np.ndarray, first: int, last: int, sign: float, closed: bool, x: float, y: float, z: float,
    normal: np.ndarray,
) -> float:  # fmt: skip
    """Return the gap to the wall of a tube. Named tuples of arrays would be counted, each array twice, in every call."""
    places = samples.shape[1]
    best, place = -np.inf, 0.0
    for piece in range(first, last):
        for s in range(places):
            dx, dy, dz = x - samples[piece, s, 0], y - samples[piece, s, 1], z - samples[piece, s, 2]
            value = samples[piece, s, 3] - np.sqrt(dx * dx + dy * dy + dz * dz)
            if value > best:
                best, place = value, piece + s / (places - 1)
    width = 1.0 / (places - 1)
    low, high = max(place - width, float(first)), min(place + width, float(last))
    t = place
    for _ in range(_NEWTON_STEPS):
        _, slope, curvature, _ = _along(curve, last, t, x, y, z)
        if slope > 0.0:
            low = t
        else:
            high = t
        following, within = t - slope / curvature if curvature < 0.0 else np.inf, _EXACT
        if not low <= following <= high:
            following, within = 0.5 * (low + high), 1e-14 * (1.0 + abs(t))
        change, t = abs(following - t), following
        if change < within:
            break
    value, slope, _, d = _along(curve, last, t, x, y, z)
    length = np.sqrt(d[0] ** 2 + d[1] ** 2 + d[2] ** 2)
    if sign < 0.0:
        end = (t <= first + 1e-12 and slope < 0.0) or (t >= last - 1e-12 and slope > 0.0 and not closed)
        if end:
            beyond = _past_end(curve, last, t, t > 0.5 * (first + last), np.array(d), value + length, normal)
            if beyond > 0.0:
                return beyond
    for i in range(3):
        normal[i] = sign * d[i] / length if length > 0.0 else 0.0
    if length == 0.0:  # on the centre line every direction is as good
        _across(curve, last, t, normal)
    return -sign * value


@njit(cache=True)
def _along(
    a: np.ndarray, last: int, t: float, x: float, y: float, z: float
) -> tuple[float, float, float, tuple[float, float, float]]:
    """Return r - |x - c| and its first and second derivatives at the place t (piece + share) of the curve a, and d = x - c."""
    piece = min(int(t), last - 1)
    s = t - piece
    d = (
        x - (((a[piece, 0, 0] * s + a[piece, 1, 0]) * s + a[piece, 2, 0]) * s + a[piece, 3, 0]),
        y - (((a[piece, 0, 1] * s + a[piece, 1, 1]) * s + a[piece, 2, 1]) * s + a[piece, 3, 1]),
        z - (((a[piece, 0, 2] * s + a[piece, 1, 2]) * s + a[piece, 2, 2]) * s + a[piece, 3, 2]),
    )
    square, along, bend, moved = 0.0, 0.0, 0.0, 0.0
    for i in range(3):
        c1 = (3.0 * a[piece, 0, i] * s + 2.0 * a[piece, 1, i]) * s + a[piece, 2, i]
        c2 = 6.0 * a[piece, 0, i] * s + 2.0 * a[piece, 1, i]
        square += d[i] * d[i]
        along += d[i] * c1
        bend += d[i] * c2
        moved += c1 * c1
    r = ((a[piece, 0, 3] * s + a[piece, 1, 3]) * s + a[piece, 2, 3]) * s + a[piece, 3, 3]
    r1 = (3.0 * a[piece, 0, 3] * s + 2.0 * a[piece, 1, 3]) * s + a[piece, 2, 3]
    r2 = 6.0 * a[piece, 0, 3] * s + 2.0 * a[piece, 1, 3]
    length = np.sqrt(square)
    if length < 1e-12:
        return r - length, r1, 0.0, d
    return r - length, r1 + along / length, r2 + (bend - moved) / length + along * along / length**3, d


@njit(cache=True)
def _past_end(curve: np.ndarray, last: int, t: float, far: bool, d: np.ndarray, radius: float, normal: np.ndarray) -> float:
    """Return the distance to the rim of an open end for a point beyond it, d (3,) from its centre, and write its direction.

    0 for a point that is not beyond.
    """
    tangent = np.empty(3)
    _tangent(curve, last, t, tangent)
    if not far:
        tangent *= -1.0
    axial = d[0] * tangent[0] + d[1] * tangent[1] + d[2] * tangent[2]
    if axial <= 0.0:
        return 0.0
    across = d - axial * tangent
    rho = np.sqrt(across[0] ** 2 + across[1] ** 2 + across[2] ** 2)
    gap = np.sqrt(axial**2 + (rho - radius) ** 2)
    for i in range(3):
        normal[i] = (axial * tangent[i] + ((rho - radius) * across[i] / rho if rho > 0.0 else 0.0)) / gap
    if rho == 0.0:
        normal[:] = tangent
    return gap


@njit(cache=True)
def _tangent(curve: np.ndarray, last: int, t: float, tangent: np.ndarray) -> None:
    piece = min(int(t), last - 1)
    s, a = t - piece, curve[piece]
    length = 0.0
    for i in range(3):
        tangent[i] = (3.0 * a[0, i] * s + 2.0 * a[1, i]) * s + a[2, i]
        length += tangent[i] ** 2
    tangent /= np.sqrt(length)


@njit(cache=True)
def _across(curve: np.ndarray, last: int, t: float, normal: np.ndarray) -> None:
    """Write a unit vector (3,) across the curve at t."""
    _tangent(curve, last, t, normal)
    least = int(np.argmin(np.abs(normal)))
    share = normal[least]
    for i in range(3):
        normal[i] = (1.0 if i == least else 0.0) - share * normal[i]
    normal /= np.sqrt(1.0 - share * share)


@njit(cache=True)
def nearest_of_all(scene: SceneArrays, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return gap (n,), normal (n, 3) and number of the obstacle (n,) for points (n, 3)."""
    count = len(points)
    gap, normal, obstacle = np.empty(count), np.empty((count, 3)), np.empty(count, dtype=np.int64)
    for i in range(count):
        gap[i], row = nearest(scene, points[i], normal[i])
        obstacle[i] = scene.obstacle[row] if row >= 0 else -1
    return gap, normal, obstacle
