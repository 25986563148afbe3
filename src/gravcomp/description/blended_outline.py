"""The outline between two of different shapes, in a transition: every point lies on the line from one to the other."""

import dataclasses
import functools
import math

import numpy as np

from gravcomp.description.outline import Outline

_PARAMETERS = np.linspace(0.0, 2 * math.pi, 513)


@dataclasses.dataclass(frozen=True)
class BlendedOutline:
    """A closed curve: the points of `one` and `other` with the same parameter, joined at `share` of the way (0: one, 1: other).

    It has the interface of `Outline`; area and second moments are those of a polygon.
    """

    one: Outline
    other: Outline
    share: float

    shape = "blend"
    round = False

    @property
    def half_width(self) -> float:
        """Half the width along x (m)."""
        return _mix(self.one.half_width, self.other.half_width, self.share)

    @property
    def half_height(self) -> float:
        """Half the height along y (m)."""
        return _mix(self.one.half_height, self.other.half_height, self.share)

    @property
    def x(self) -> float:
        """The x of its middle (m)."""
        return _mix(self.one.x, self.other.x, self.share)

    @property
    def y(self) -> float:
        """The y of its middle (m)."""
        return _mix(self.one.y, self.other.y, self.share)

    def boundary(self, angle: np.ndarray) -> np.ndarray:
        """Return points (k, 2) for the parameters `angle` (k,), in rad; see `Outline.boundary`."""
        return (1.0 - self.share) * self.one.boundary(angle) + self.share * self.other.boundary(angle)

    def gauge(self, x: float, y: float) -> float:
        """Return the distance of the point (x, y) from the middle, relative to that of the curve in its direction."""
        angle, radius = self._polar
        there = float(np.interp(math.atan2(y - self.y, x - self.x), angle, radius, period=2 * math.pi))
        return math.hypot(x - self.x, y - self.y) / there

    def parameter(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the parameters (...,) in rad of the points of the curve in the directions of the points (x, y)."""
        angle, _ = self._polar
        towards = np.arctan2(y - self.y, x - self.x)
        turned = np.unwrap(angle) - angle[0]
        return np.interp(np.mod(towards - angle[0], 2 * math.pi), [*turned, 2 * math.pi], _PARAMETERS)

    def reach(self, x: float, y: float, angle: np.ndarray) -> np.ndarray:
        """Return the distances (k,) in m from a point (x, y) inside to the curve in the directions `angle` (k,), in rad."""
        begin = self._polygon - [x, y]
        side = np.roll(begin, -1, axis=0) - begin
        cos, sin = np.cos(angle)[:, None], np.sin(angle)[:, None]
        across = cos * side[:, 1] - sin * side[:, 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = (begin[:, 0] * side[:, 1] - begin[:, 1] * side[:, 0]) / across
            part = (begin[:, 0] * sin - begin[:, 1] * cos) / across
        hit = (part >= -1e-9) & (part <= 1.0 + 1e-9) & (distance > 0.0)
        return np.where(hit, distance, np.inf).min(axis=1)

    @property
    def area(self) -> float:
        """Enclosed area (m^2)."""
        return self._moments[0]

    @property
    def second_moments(self) -> tuple[float, float, float]:
        """Integrals of y^2, x^2 and x y over the enclosed area, about the axis (m^4)."""
        return self._moments[1]

    @functools.cached_property
    def _polygon(self) -> np.ndarray:
        return self.boundary(_PARAMETERS[:-1])

    @functools.cached_property
    def _polar(self) -> tuple[np.ndarray, np.ndarray]:
        x, y = (self._polygon - [self.x, self.y]).T
        return np.arctan2(y, x), np.hypot(x, y)

    @functools.cached_property
    def _moments(self) -> tuple[float, tuple[float, float, float]]:
        (x0, y0), (x1, y1) = self._polygon.T, np.roll(self._polygon, -1, axis=0).T
        cross = x0 * y1 - x1 * y0
        yy = float(cross @ (y0**2 + y0 * y1 + y1**2)) / 12
        xx = float(cross @ (x0**2 + x0 * x1 + x1**2)) / 12
        xy = float(cross @ (x0 * y1 + 2 * x0 * y0 + 2 * x1 * y1 + x1 * y0)) / 24
        return float(cross.sum()) / 2, (yy, xx, xy)

    def __str__(self) -> str:
        return f"{100 * self.share:.0f} % of the way from {self.one} to {self.other}"


def outline_between(one: Outline, other: Outline, share: float) -> Outline | BlendedOutline:
    """Return the outline at `share` of the way from one to the other, 0 to 1, where every point moves on a line."""
    if share <= 0.0 or one == other:
        return one
    if share >= 1.0:
        return other
    if one.shape != other.shape:
        return BlendedOutline(one, other, share)
    sizes = (_mix(getattr(one, key), getattr(other, key), share) for key in ("half_width", "half_height", "x", "y"))
    return Outline(one.shape, *sizes)


def _mix(one: float, other: float, share: float) -> float:
    return (1.0 - share) * one + share * other
