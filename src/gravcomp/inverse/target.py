"""The target shape: position and direction of the tip and points of the backbone, each with a weight.

The inverse problem minimises  sum_i w_i |e_i - target_i|^2. Weights are relative to one another: 1 for the position of the tip
is the usual choice; the weight of the tip's direction is in m^2, so that with 0.01 an angle of 0.1 rad counts like 10 mm. A
part with weight 0 is free. A bend of constant curvature gives all of them: an arc of length L, bent by the angle theta in the
plane at phi, has at the arc length s = station * L

    p(s) = (rho cos(phi), rho sin(phi), z),   rho = L/theta (1 - cos(theta s/L)),   z = L/theta sin(theta s/L).
"""

import copy
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

_NO_DIRECTION = np.zeros(3)
REACH = 1.5  # of the robot's length
LARGEST_WEIGHT = 1e3  # more comes near the cost that keeps the cables within their bounds (`solver`)
_DIRECTION_SHARE = 0.1  # of the square of the robot's length


class TargetError(ValueError):
    """A target that cannot be used; the text says what was found and what is allowed."""


@dataclass(frozen=True)
class Target:
    """A shape to keep, in `soft_base`.

    tip_position (3,) in m; tip_direction (3,) along the robot at its tip, normalised here; None: the direction is free, and
    axial errors are along the present direction of the tip; backbone_station (k,) from 0 at the base to 1 at the tip;
    backbone_position (k, 3) in m; backbone_weight (k,). Raises TargetError for values that are not finite, wrong shapes, and
    targets without any weight.
    """

    tip_position: np.ndarray
    tip_position_weight: float = 1.0
    tip_direction: np.ndarray | None = None
    tip_direction_weight: float = 0.0
    backbone_station: np.ndarray = field(default_factory=lambda: np.zeros(0))
    backbone_position: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    backbone_weight: np.ndarray = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        set_ = object.__setattr__
        set_(self, "tip_position", _finite(self.tip_position, (3,), "tip_position"))
        if self.tip_direction is not None:
            direction = _finite(self.tip_direction, (3,), "tip_direction")
            length = float(np.linalg.norm(direction))
            if length < 1e-9:
                raise TargetError("tip_direction has length 0; give a direction or leave it out")
            set_(self, "tip_direction", direction / length)
        stations = _finite(self.backbone_station, (-1,), "backbone_station")
        set_(self, "backbone_station", stations)
        set_(self, "backbone_position", _finite(self.backbone_position, (stations.size, 3), "backbone_position"))
        set_(self, "backbone_weight", _finite(self.backbone_weight, (stations.size,), "backbone_weight"))
        if stations.size and (stations.min() < 0.0 or stations.max() > 1.0):
            found = f"{stations.min():g} to {stations.max():g}"
            raise TargetError(f"backbone_station runs from {found}; allowed: 0 (base) to 1 (tip)")
        weights = np.array([self.tip_position_weight, self.tip_direction_weight, *self.backbone_weight])
        if not np.all(np.isfinite(weights)) or weights.min() < 0.0 or weights.max() > LARGEST_WEIGHT:
            raise TargetError(f"weights are {weights.tolist()}; finite numbers from 0 to {LARGEST_WEIGHT:g} are needed")
        if self.tip_direction is None and self.tip_direction_weight > 0.0:
            raise TargetError("tip_direction_weight is given without a tip_direction")
        if weights.max() == 0.0:
            raise TargetError("every weight is 0; at least one weight above 0 is needed")

    def check_reach(self, length: float) -> None:
        """Raise TargetError for a weighted point that is out of reach of a robot of `length` (m).

        Such a point is probably in a wrong unit or frame; the cables would bend the robot as far as they can.
        """
        points = {"tip_position": self.tip_position} if self.tip_position_weight > 0.0 else {}
        points |= {f"backbone_position {k}": p for k, p in enumerate(self.backbone_position) if self.backbone_weight[k] > 0.0}
        for name, point in points.items():
            distance = float(np.linalg.norm(point))
            if distance > REACH * length:
                raise TargetError(
                    f"{name} is {distance:.3g} m from the base; allowed for a robot of {length:g} m: up to {REACH * length:g} m"
                )

    def with_tip_at(self, position: np.ndarray) -> "Target":
        """Return this target with its tip at `position` (3,) in m; what stays has been checked.

        Raises TargetError for a position that is not finite.
        """
        moved = copy.copy(self)
        object.__setattr__(moved, "tip_position", _finite(position, (3,), "tip_position"))
        return moved

    @property
    def direction_or_zeros(self) -> np.ndarray:
        """tip_direction (3,); zeros if the direction is free."""
        return _NO_DIRECTION if self.tip_direction is None else self.tip_direction


def bend_target(
    length: float,
    angle: float,
    plane: float,
    *,
    tip_position_weight: float = 1.0,
    tip_direction_weight: float = 0.0,
    backbone_station: np.ndarray | Sequence[float] = (),
    backbone_weight: np.ndarray | Sequence[float] = (),
) -> Target:
    """Return the target of constant curvature: a robot of `length` m bent by `angle` rad in the plane at `plane` rad about z.

    Raises TargetError for numbers that are not finite, a length of 0 or less, and more than a full turn.

    >>> target = bend_target(0.1, np.radians(90.0), 0.0)
    >>> target.tip_position.round(4)  # m: an arc of radius 0.1 m / (pi / 2)
    array([0.0637, 0.    , 0.0637])
    >>> target.tip_direction.round(3)
    array([1., 0., 0.])
    """
    if not np.all(np.isfinite([length, angle, plane])) or length <= 0.0 or abs(angle) > 2.0 * np.pi:
        bend = f"a bend of {angle!r} rad at {plane!r} rad over {length!r} m"
        raise TargetError(f"{bend}; finite numbers and at most a full turn are needed")
    stations = np.asarray(backbone_station, float)
    points = arc_points(length, angle, plane, np.append(stations, 1.0))
    direction = np.array([np.sin(angle) * np.cos(plane), np.sin(angle) * np.sin(plane), np.cos(angle)])
    return Target(
        tip_position=points[-1],
        tip_position_weight=tip_position_weight,
        tip_direction=direction,
        tip_direction_weight=tip_direction_weight,
        backbone_station=stations,
        backbone_position=points[:-1],
        backbone_weight=np.asarray(backbone_weight, float),
    )


def straight_target(length: float, **weights: Any) -> Target:
    """Return the target of the straight robot of `length` m; the keyword arguments are those of `bend_target`."""
    return bend_target(length, 0.0, 0.0, **weights)


def direction_weight(length: float, given: float | None = None) -> float:
    """Return the weight of the tip's direction in m^2 for a robot of `length` m: the given one, else that of the robot's size.

    >>> direction_weight(0.2)  # 0.1 rad counts like 6.3 mm
    0.004
    """
    return round(_DIRECTION_SHARE * length**2, 12) if given is None else given


def arc_points(length: float, angle: float, plane: float, station: np.ndarray) -> np.ndarray:
    """Return points (k, 3) in m of the arc at the stations (k,)."""
    s = np.asarray(station, float) * length
    half = 0.5 * angle * s / length
    chord = s * np.sinc(half / np.pi)  # np.sinc(x) is sin(pi x)/(pi x): no division by zero on the straight robot
    return np.stack([chord * np.sin(half) * np.cos(plane), chord * np.sin(half) * np.sin(plane), chord * np.cos(half)], axis=1)


def _finite(value: Any, shape: tuple[int, ...], name: str) -> np.ndarray:
    """Return the value as an array of the shape, in which -1 stands for any length. Raises TargetError."""
    array = np.array(value, dtype=float)
    if array.size == 0 and 0 in shape:
        array = array.reshape(shape)
    expected = tuple(n if want == -1 else want for n, want in zip(array.shape, shape)) if array.ndim == len(shape) else shape
    if array.shape != expected:
        raise TargetError(f"{name} has the shape {array.shape}; {shape} is needed".replace("-1", "any"))
    if not np.all(np.isfinite(array)):
        raise TargetError(f"{name} is {array.tolist()}; finite numbers are needed")
    return array
