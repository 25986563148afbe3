"""The surface of the rod: the outline of each section, as far as other things can touch it.

Between two cross-sections the surface is spanned by straight lines along the bent axis. The axis is a cubic (Hermite) curve
through both sections, so that a point of the surface is fixed to the two sections next to it:

    x = w_A p_A + R_A d_A + w_B p_B + R_B d_B,    w_A + w_B = 1
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from gravcomp.description import MeshBody, Outline
from gravcomp.virtual.rod import RodModel
from gravcomp.virtual.sliced_body import slice_boundary
from gravcomp.virtual.stretches import Stretch, stretch_at, stretches_of
from gravcomp.virtual.true_robot import TrueRobot

_WITHIN = 0.9  # of the way from its middle to an outline: nearer to the middle a point is not part of the outline
_POINTS = 96  # of an outline that is neither ellipse nor rectangle


class RodSurface(NamedTuple):
    """Outlines of n + 1 cross-sections, then of the n elements at their base, then of the n elements at their tip.

    A cross-section has the larger of the outlines that meet there, or that of its disk.
    """

    middle: np.ndarray  # (3 n + 1, 2) m
    half: np.ndarray  # (3 n + 1, 2) m, of the ellipse; of a polygon the half widths
    corner: np.ndarray  # (3 n + 1, c, 2) m, of the polygon
    corners: np.ndarray  # (3 n + 1,) int; 0: an ellipse
    size: np.ndarray  # (3 n + 1,) m, largest distance from the axis

    @staticmethod
    def none() -> "RodSurface":
        """Return a surface without sections, of a rod that has nothing to touch."""
        return RodSurface(np.empty((0, 2)), np.empty((0, 2)), np.empty((0, 0, 2)), np.empty(0, np.int64), np.empty(0))


def rod_surface(model: RodModel, true: TrueRobot) -> RodSurface:
    """Return the surface of the rod. Raises ConfigError for a body from a file that has no section somewhere."""
    stretches = stretches_of(true.robot)
    ends = model.station * true.robot.length
    base, tip = [], []
    for a, b in zip(ends, ends[1:]):
        stretch = stretch_at(stretches, (a + b) / 2)
        base.append(_outline(stretch, a))
        tip.append(_outline(stretch, b))
    sections = [max(pair, key=_size) for pair in zip([base[0], *tip], [*base, tip[-1]])]
    for height, diameter in _disks(true):
        sections[int(np.argmin(np.abs(ends - height)))] = Outline.circle(diameter)
    outlines = [*sections, *base, *tip]
    polygons = [np.empty((0, 2)) if isinstance(outline, Outline) and outline.shape == "ellipse" else _polygon(outline)
                for outline in outlines]  # fmt: skip
    corner = np.zeros((len(outlines), max(map(len, polygons)), 2))
    middle, half = np.zeros((len(outlines), 2)), np.zeros((len(outlines), 2))
    for index, (outline, polygon) in enumerate(zip(outlines, polygons)):
        corner[index, : len(polygon)] = polygon
        if not isinstance(outline, Outline) or len(polygon):
            middle[index], half[index] = (polygon.max(axis=0) + polygon.min(axis=0)) / 2, np.ptp(polygon, axis=0) / 2
        else:
            middle[index], half[index] = (outline.x, outline.y), (outline.half_width, outline.half_height)
    return RodSurface(middle, half, corner, np.array([len(p) for p in polygons]), np.array([_size(o) for o in outlines]))


@njit(cache=True, error_model="numpy")
def farthest(surface: RodSurface, section: int, x: float, y: float, out: np.ndarray) -> None:
    """Write the point (3,) of the outline that lies farthest in the direction (x, y), in the section's plane, to out."""
    out[2] = 0.0
    if surface.corners[section] == 0:
        a, b = surface.half[section, 0] * x, surface.half[section, 1] * y
        length = math.sqrt(a * a + b * b)
        out[0] = surface.middle[section, 0] + surface.half[section, 0] * a / length
        out[1] = surface.middle[section, 1] + surface.half[section, 1] * b / length
        return
    best = -np.inf
    for k in range(surface.corners[section]):
        along = surface.corner[section, k, 0] * x + surface.corner[section, k, 1] * y
        if along > best:
            best, out[0], out[1] = along, surface.corner[section, k, 0], surface.corner[section, k, 1]


@njit(cache=True, error_model="numpy")
def inside(surface: RodSurface, section: int, out: np.ndarray) -> bool:
    """Return whether a point out (3,) of the section's plane lies well inside the outline; move it there from outside."""
    x, y = out[0] - surface.middle[section, 0], out[1] - surface.middle[section, 1]
    distance = 0.0  # relative to the outline
    if surface.corners[section] == 0:
        distance = math.sqrt((x / surface.half[section, 0]) ** 2 + (y / surface.half[section, 1]) ** 2)
    else:
        count = surface.corners[section]
        for k in range(count):
            a, b = surface.corner[section, k], surface.corner[section, (k + 1) % count]
            across, along = b[1] - a[1], a[0] - b[0]
            room = (a[0] - surface.middle[section, 0]) * across + (a[1] - surface.middle[section, 1]) * along
            if room > 0.0:
                distance = max(distance, (x * across + y * along) / room)
    if distance > 1.0:
        out[0], out[1] = surface.middle[section, 0] + x / distance, surface.middle[section, 1] + y / distance
    out[2] = 0.0
    return distance < _WITHIN


def _outline(stretch: Stretch, s: float) -> Outline | np.ndarray:
    """The outline of a stretch at the arc length s, or the corners (c, 2) of its convex hull."""
    if isinstance(stretch.source, MeshBody):
        return _hull(slice_boundary(stretch.source, (s - stretch.start) / stretch.length))
    outline, _ = stretch.source.visible.section(s)
    if isinstance(outline, Outline):
        return outline
    return _hull(outline.boundary(np.linspace(0.0, 2 * math.pi, _POINTS, endpoint=False)))


def _hull(points: np.ndarray) -> np.ndarray:
    from scipy.spatial import ConvexHull

    return points[ConvexHull(points).vertices]


def _polygon(outline: Outline | np.ndarray) -> np.ndarray:
    if isinstance(outline, Outline):
        return outline.boundary(np.radians([45.0, 135.0, 225.0, 315.0]))
    return outline


def _size(outline: Outline | np.ndarray) -> float:
    if isinstance(outline, Outline):
        reach = max(outline.half_width, outline.half_height)
        if outline.shape != "ellipse":
            reach = math.hypot(outline.half_width, outline.half_height)
        return math.hypot(outline.x, outline.y) + reach
    return float(np.linalg.norm(outline, axis=1).max())


def _disks(true: TrueRobot) -> list[tuple[float, float]]:
    """Height (m) and diameter (m) of each disk."""
    found, base = [], 0.0
    for segment in true.robot.segments:
        if segment.disks:
            found += [(base + height, segment.disks.outer_diameter) for height in segment.disks.heights(segment.length)]
        base += segment.full_length
    return found
