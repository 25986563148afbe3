"""Outline of a cross-section or of a lumen: an ellipse (a circle among them) or a rectangle."""

import dataclasses
import functools
import math
from typing import Protocol

import numpy as np

_SAME = 1e-9  # m


class HasGauge(Protocol):
    """A closed curve around its middle."""

    @property
    def x(self) -> float:
        """The x of its middle (m)."""

    @property
    def y(self) -> float:
        """The y of its middle (m)."""

    def gauge(self, x: float, y: float) -> float:
        """Return the distance of the point (x, y) from the middle, relative to that of the curve in its direction."""


@dataclasses.dataclass(frozen=True)
class Outline:
    """A closed curve in the cross-section's plane.

    shape: 'ellipse' or 'rectangle'; half_width and half_height (m) along x and y; x, y (m): its middle.
    """

    shape: str
    half_width: float
    half_height: float
    x: float = 0.0
    y: float = 0.0

    @staticmethod
    def circle(diameter: float, x: float = 0.0, y: float = 0.0) -> "Outline":
        """Return a circle."""
        return Outline("ellipse", diameter / 2, diameter / 2, x, y)

    @property
    def round(self) -> bool:
        """Whether it is a circle around the axis."""
        centred = self.x == 0.0 and self.y == 0.0
        return self.shape == "ellipse" and centred and math.isclose(self.half_width, self.half_height, rel_tol=1e-9)

    def boundary(self, angle: np.ndarray) -> np.ndarray:
        """Return points (k, 2) for the parameters `angle` (k,), in rad.

        On an ellipse the parameter is the eccentric angle. A rectangle has its corners at odd multiples of 45 deg, and the
        parameter grows evenly along each side.
        """
        angle = np.asarray(angle, dtype=float)
        if self.shape == "ellipse":
            unit = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        else:
            quarter = np.round(angle / (math.pi / 2))
            along = (angle - quarter * (math.pi / 2)) / (math.pi / 4)
            side = quarter.astype(int) % 4
            x, y = (
                [np.ones_like(along), -along, -np.ones_like(along), along],
                [along, np.ones_like(along), -along, -np.ones_like(along)],
            )
            unit = np.stack([np.choose(side, x), np.choose(side, y)], axis=-1)
        return np.array([self.x, self.y]) + unit * [self.half_width, self.half_height]

    def gauge(self, x: float, y: float) -> float:
        """Return the distance of the point (x, y) from the middle, relative to that of the curve in its direction."""
        u, v = abs(x - self.x) / self.half_width, abs(y - self.y) / self.half_height
        return math.hypot(u, v) if self.shape == "ellipse" else max(u, v)

    def parameter(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the parameters (...,) in rad, see `boundary`, of the curve in the directions of the points (x, y)."""
        u, v = (x - self.x) / self.half_width, (y - self.y) / self.half_height
        if self.shape == "ellipse":
            return np.arctan2(v, u)
        upright = np.abs(u) >= np.abs(v)
        along = np.where(upright, v, -u) / np.where(upright, np.abs(u), np.abs(v)) * np.where(upright, np.sign(u), np.sign(v))
        side = np.where(upright, np.where(u > 0, 0, 2), np.where(v > 0, 1, 3))
        return side * (math.pi / 2) + along * (math.pi / 4)

    def reach(self, x: float, y: float, angle: np.ndarray) -> np.ndarray:
        """Return the distances (k,) in m from a point (x, y) inside to the curve in the directions `angle` (k,), in rad."""
        u, v = (x - self.x) / self.half_width, (y - self.y) / self.half_height
        du, dv = np.cos(angle) / self.half_width, np.sin(angle) / self.half_height
        if self.shape == "ellipse":
            a, b = du**2 + dv**2, u * du + v * dv
            return (-b + np.sqrt(b**2 + a * (1.0 - u**2 - v**2))) / a
        with np.errstate(divide="ignore"):
            to_side = (1.0 - u * np.sign(du)) / np.abs(du)
            to_top = (1.0 - v * np.sign(dv)) / np.abs(dv)
        return np.minimum(to_side, to_top)

    def alike(self, other: "Outline") -> bool:
        """Return whether the other outline is the same but for rounding."""
        pairs = zip(dataclasses.astuple(self)[1:], dataclasses.astuple(other)[1:])
        return self.shape == other.shape and all(abs(a - b) < _SAME for a, b in pairs)

    @property
    def area(self) -> float:
        """Enclosed area (m^2)."""
        return (math.pi if self.shape == "ellipse" else 4.0) * self.half_width * self.half_height

    @property
    def second_moments(self) -> tuple[float, float, float]:
        """Integrals of y^2, x^2 and x y over the enclosed area, about the axis (m^4)."""
        factor = 1.0 / 4.0 if self.shape == "ellipse" else 1.0 / 3.0
        return (
            self.area * (factor * self.half_height**2 + self.y**2),
            self.area * (factor * self.half_width**2 + self.x**2),
            self.area * self.x * self.y,
        )

    def __str__(self) -> str:
        width, height = 2e3 * self.half_width, 2e3 * self.half_height
        if self.shape == "ellipse" and math.isclose(width, height, rel_tol=1e-9):
            text = f"circle of {width:g} mm"
        else:
            text = f"{self.shape} of {width:g} x {height:g} mm"
        return text if self.x == 0.0 == self.y else f"{text} at ({self.x * 1e3:g}, {self.y * 1e3:g}) mm"


@functools.lru_cache(maxsize=256)  # robots of a fit, or with other materials, have the outlines of the first
def encloses(outer: HasGauge, inner: Outline, gap: float) -> bool:
    """Return whether `inner` lies inside `outer` with at least `gap` (m) between them."""
    for x, y in inner.boundary(np.linspace(0.0, 2 * math.pi, 48, endpoint=False)):
        reach = math.hypot(x - outer.x, y - outer.y)
        if outer.gauge(x, y) * (1.0 + (gap / reach if reach > 0 else 0.0)) > 1.0 + 1e-9:
            return False
    return True
