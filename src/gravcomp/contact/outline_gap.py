"""The point of a section's outline with the smallest gap to an obstacle; compiled.

Where the wall is smooth, the point is found by going around the outline to where the normal points, a few times.

At a sharp edge of an obstacle the signed distance has no gradient: that of a point on the edge is any direction between the
normals of both faces, and which of them is found depends on rounding. There the robot's own surface, which is smooth, tells the
direction of the force. The gap is that of a ball inside the robot that touches its surface at the point p, with the centre q:

    g = d(q) - |p - q|      for the signed distance d.

q is off the edge, where d is smooth. g is never larger than d(p), and they are the same where the normal n(q), the gradient of
d, is across the robot's surface, as it is where the robot touches anywhere but at its ends. Towards both ends the balls become
smaller, so that they do not reach out of the robot, into a wall ahead or the block on which it is mounted. Where the ball does
not fill the section, g = d(q) + n(q) . (p - q), which is exact for a wall of any direction. Obstacles with edges are cuboids
and surfaces.
"""

import numpy as np
from numba import njit

from gravcomp.contact.surface import ContactSurface
from gravcomp.scene.distance import BOX, SURFACE, SceneArrays, gap_to

_TURNS = 4  # corrections of the direction in which the outline is nearest
_SEARCH, _FOUND = 12, 1e-8  # turns of the search next to edges, and rad of the last of them
_BLUNT = 0.05  # of the radius: the smallest ball, at an end, by half of which the rim of its face is blunt next to an edge
_LARGEST = 0.5  # of the radius: the largest ball next to a surface, which may have another wall behind the robot
_CONCAVE = 1e-6  # of the radius by which a surface is nearer than next to the ball: it is hollow there
_SETTLED = 1e-5  # of the radius: what it changes of the gap is the square of that


@njit(cache=True, inline="always")
def deepest(
    scene: SceneArrays, row: int, surface: ContactSurface, station: int, section: np.ndarray, own: np.ndarray, normal: np.ndarray
) -> float:
    """Return the smallest gap of a section (3, 3) p, f_1, f_2, and write where it is in the section and the normal there."""
    middle = gap_to(scene, row, section[0], normal)
    return deepest_from(scene, row, surface, station, section, middle, own, normal)


@njit(cache=True, inline="always")
def deepest_from(
    scene: SceneArrays, row: int, surface: ContactSurface, station: int, section: np.ndarray, middle: float, own: np.ndarray,
    normal: np.ndarray,
) -> float:  # fmt: skip
    """Do as `deepest`, where the gap and the normal at the section's middle are known."""
    if scene.kind[row] == BOX or scene.kind[row] == SURFACE:
        return _deepest_at_edges(scene, row, surface, station, section, middle, own, normal)
    radius, point, gap = surface.radius[station], np.empty(3), np.inf
    for turn in range(_TURNS):
        x, y = _against(normal, section)
        before_x, before_y = own[0], own[1]
        _farthest(surface, station, x, y, own)
        if turn and abs(own[0] - before_x) + abs(own[1] - before_y) < _SETTLED * radius:
            break
        _point_at(section, own[0], own[1], point)
        gap = gap_to(scene, row, point, normal)
    return gap


@njit(cache=True)
def _against(normal: np.ndarray, section: np.ndarray) -> tuple[float, float]:
    """Return the direction against the normal (3,) as x and y in the section."""
    return (
        -(normal[0] * section[1, 0] + normal[1] * section[1, 1] + normal[2] * section[1, 2]),
        -(normal[0] * section[2, 0] + normal[1] * section[2, 1] + normal[2] * section[2, 2]),
    )


@njit(cache=True)
def _point_at(section: np.ndarray, x: float, y: float, point: np.ndarray) -> None:
    """Write the point (3,) at x and y in m of a section (3, 3)."""
    for i in range(3):
        point[i] = section[0, i] + x * section[1, i] + y * section[2, i]


@njit(cache=True)
def _reach(section: np.ndarray, x: float, y: float) -> float:
    """Return how far the point at x and y in m of a section (3, 3) is from its middle."""
    square = 0.0
    for i in range(3):
        square += (x * section[1, i] + y * section[2, i]) ** 2
    return np.sqrt(square)


@njit(cache=True)
def _farthest(surface: ContactSurface, station: int, x: float, y: float, own: np.ndarray) -> None:
    """Write the point own (2,) of the outline that is farthest in the direction x, y."""
    if surface.outline.shape[1] == 0:
        radius, length = surface.radius[station], np.sqrt(x * x + y * y)
        own[0], own[1] = (radius * x / length, radius * y / length) if length > 1e-9 else (radius, 0.0)
        return
    farthest = -np.inf
    for c in range(surface.outline.shape[1]):
        corner = surface.outline[station, c]
        reach = x * corner[0] + y * corner[1]
        if reach > farthest:
            farthest = reach
            own[0], own[1] = corner[0], corner[1]


@njit(cache=True)
def _deepest_at_edges(
    scene: SceneArrays, row: int, surface: ContactSurface, station: int, section: np.ndarray, middle: float, own: np.ndarray,
    normal: np.ndarray,
) -> float:  # fmt: skip
    """Do as `deepest_from` next to an obstacle with edges: with a ball, the largest one that the robot holds.

    The direction a in the section is sought at which the normal of the ball there points back to its middle. At an edge along the
    robot, going where the normal points leads past it: then a lies between the last two, and is found by the Illinois method.
    """
    share, point, from_middle = ball(scene.kind[row], surface, station), np.empty(3), normal.copy()
    x, y = _against(normal, section)
    length = np.sqrt(x * x + y * y)
    first_x, first_y = (x / length, y / length) if length > 1e-9 else (1.0, 0.0)
    gap, ahead = np.inf, np.zeros(2)
    angle, last, off_last, other, off_other, between = 0.0, 0.0, 0.0, 0.0, 0.0, False
    for turn in range(_SEARCH):
        ahead[0] = np.cos(angle) * first_x - np.sin(angle) * first_y
        ahead[1] = np.sin(angle) * first_x + np.cos(angle) * first_y
        _farthest(surface, station, ahead[0], ahead[1], own)
        distance = middle
        if share < 1.0:
            _point_at(section, (1.0 - share) * own[0], (1.0 - share) * own[1], point)
            distance = gap_to(scene, row, point, normal)
            if distance <= 0.0 < middle:  # too deep for this ball: the largest one, at the middle of the section
                share, distance, normal[:] = 1.0, middle, from_middle
                _farthest(surface, station, first_x, first_y, own)
        x, y = _against(normal, section)
        if share == 1.0:
            gap = distance - _reach(section, own[0], own[1])
        else:
            gap = distance - share * (own[0] * x + own[1] * y)
        if share == 1.0 or x * x + y * y < 1e-18:
            break
        off = np.arctan2(ahead[0] * y - ahead[1] * x, ahead[0] * x + ahead[1] * y)
        if abs(off) < _FOUND:
            break
        if turn and off * off_last < 0.0:
            other, off_other, between = last, off_last, True
        elif between:
            off_other *= 0.5
        last, off_last = angle, off
        angle = (angle * off_other - other * off) / (off_other - off) if between else angle + off
    if scene.kind[row] == SURFACE:  # between two faces of a hollow, the ball may touch only one of them
        _point_at(section, own[0], own[1], point)
        hollow = gap_to(scene, row, point, from_middle)
        if hollow < gap - _CONCAVE * surface.radius[station]:
            gap, normal[:] = hollow, from_middle
    return gap


@njit(cache=True)
def ball(kind: int, surface: ContactSurface, station: int) -> float:
    """Return the radius of the ball next to an obstacle with edges, as a share of the way from the outline to the middle."""
    if surface.outline.shape[1]:
        return _BLUNT
    largest, place = _LARGEST if kind == SURFACE else 1.0, surface.place[station]
    return min(max(min(place, surface.place[-1] - place) / surface.radius[station], _BLUNT), largest)
