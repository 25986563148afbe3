"""The picture of a camera at the robot's tip that looks along it, as the person of `gravcomp.operator` sees it.

A place in the picture is given by angles, as in `operator.picture`: how far a point lies off the middle is the angle between the
line of sight and the tip's direction. The tip's x axis points up, which is upright for a horizontal robot, and its y axis to the
right. The camera brings its own light: what it looks at straight is bright, what is far away is dark.
"""

import math

import numpy as np
from numba import njit

from gravcomp.view import colours
from gravcomp.view.colours import Rgb

HALF_VIEW = math.radians(70.0)
"""Angle (rad) that is seen to every side."""

_BEHIND = 2.6  # rad off the middle, beyond which a point has no place near the picture
_AMBIENT = 0.25
_EMPTY, _OUTSIDE = np.array([6.0, 8.0, 12.0]), np.array([36.0, 36.0, 36.0])
_RING, _LINE = 0.08, 0.022  # radius and half the width of the target's ring, in halves of the picture
# Right, down and forward of the picture, as columns in the tip's section.
_AXES = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])

Surface = tuple[np.ndarray, np.ndarray, Rgb]
"""Vertices (v, 3) m in soft_base, faces (f, 3), colour."""


class TipCamera:
    """Draws square pictures of `size` px; reach (m): where the light of the camera has fallen to a half."""

    def __init__(self, size: int, reach: float) -> None:
        self._size, self._reach = size, reach
        place = (np.arange(size) + 0.5) / size * 2.0 - 1.0
        self._right, self._down = np.meshgrid(place, place)
        self._round = np.hypot(self._right, self._down) < 1.0

    def picture(
        self, surfaces: list[Surface], tip: np.ndarray, rotation: np.ndarray, target: np.ndarray | None = None
    ) -> np.ndarray:
        """Return the picture (size, size, 3), uint8, at the tip (3,) m with the axes rotation (3, 3), in soft_base.

        target (3,) m: marked by a ring, which is dark where a surface hides the target.
        """
        view = rotation @ _AXES
        colour = np.tile(_EMPTY, (self._size, self._size, 1))
        depth = np.full((self._size, self._size), np.inf)
        for vertices, faces, paint in surfaces:
            own = (np.asarray(vertices, dtype=float) - tip) @ view
            _draw(own, np.ascontiguousarray(faces, dtype=np.int64), np.array(paint, float), self._reach, colour, depth)
        if target is not None:
            self._mark(colour, depth, (target - tip) @ view)
        colour[~self._round] = _OUTSIDE
        return np.clip(colour, 0.0, 255.0).astype(np.uint8)

    def _mark(self, colour: np.ndarray, depth: np.ndarray, own: np.ndarray) -> None:
        right, down = place(own)
        if not math.hypot(right, down) < 1.0:
            return
        middle = np.clip((np.array([down, right]) + 1.0) / 2.0 * self._size, 0, self._size - 1).astype(int)
        hidden = depth[middle[0], middle[1]] < np.linalg.norm(own)
        ring = np.abs(np.hypot(self._right - right, self._down - down) - _RING) < _LINE
        colour[ring] = np.array(colours.TARGET, float) * (0.45 if hidden else 1.0)


def place(own: np.ndarray) -> tuple[float, float]:
    """Return the place in the picture of a point (3,) in the camera's frame, right and down in halves of the picture."""
    across = math.hypot(own[0], own[1])
    share = math.atan2(across, own[2]) / HALF_VIEW / across if across > 0.0 else 0.0
    return share * own[0], share * own[1]


@njit(cache=True)
def _draw(own: np.ndarray, faces: np.ndarray, paint: np.ndarray, reach: float, colour: np.ndarray, depth: np.ndarray) -> None:
    """Draw triangles of vertices (v, 3) m in the camera's frame into colour (n, n, 3) and depth (n, n) m, the nearest first."""
    n, count = depth.shape[0], own.shape[0]
    right, down, angle, away = np.empty(count), np.empty(count), np.empty(count), np.empty(count)
    for v in range(count):
        across = math.hypot(own[v, 0], own[v, 1])
        angle[v] = math.atan2(across, own[v, 2])
        away[v] = math.sqrt(across * across + own[v, 2] * own[v, 2])
        share = angle[v] / HALF_VIEW / across if across > 0.0 else 0.0
        right[v] = (share * own[v, 0] + 1.0) * 0.5 * n - 0.5
        down[v] = (share * own[v, 1] + 1.0) * 0.5 * n - 0.5
    for f in range(faces.shape[0]):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        if min(angle[a], angle[b], angle[c]) > HALF_VIEW or max(angle[a], angle[b], angle[c]) > _BEHIND:
            continue
        left, end = max(0, int(min(right[a], right[b], right[c]))), min(n - 1, int(max(right[a], right[b], right[c])) + 1)
        top, low = max(0, int(min(down[a], down[b], down[c]))), min(n - 1, int(max(down[a], down[b], down[c])) + 1)
        area = (right[b] - right[a]) * (down[c] - down[a]) - (right[c] - right[a]) * (down[b] - down[a])
        if left > end or top > low or abs(area) < 1e-12:
            continue
        bright = _AMBIENT + (1.0 - _AMBIENT) * _facing(own, a, b, c)
        for i in range(top, low + 1):
            for j in range(left, end + 1):
                u = ((right[b] - j) * (down[c] - i) - (right[c] - j) * (down[b] - i)) / area
                v = ((right[c] - j) * (down[a] - i) - (right[a] - j) * (down[c] - i)) / area
                w = 1.0 - u - v
                if u < -1e-9 or v < -1e-9 or w < -1e-9:
                    continue
                distance = u * away[a] + v * away[b] + w * away[c]
                if distance < depth[i, j]:
                    depth[i, j] = distance
                    light = bright / (1.0 + (distance / reach) ** 2)
                    for k in range(3):
                        colour[i, j, k] = light * paint[k]


@njit(cache=True)
def _facing(own: np.ndarray, a: int, b: int, c: int) -> float:
    """Return the cosine between a triangle's normal and the line of sight to it, as a size."""
    px, py, pz = own[b, 0] - own[a, 0], own[b, 1] - own[a, 1], own[b, 2] - own[a, 2]
    qx, qy, qz = own[c, 0] - own[a, 0], own[c, 1] - own[a, 1], own[c, 2] - own[a, 2]
    x, y, z = py * qz - pz * qy, pz * qx - px * qz, px * qy - py * qx
    mx, my, mz = own[a, 0] + own[b, 0] + own[c, 0], own[a, 1] + own[b, 1] + own[c, 1], own[a, 2] + own[b, 2] + own[c, 2]
    size = math.sqrt((x * x + y * y + z * z) * (mx * mx + my * my + mz * mz))
    return abs(x * mx + y * my + z * mz) / size if size > 0.0 else 0.0
