"""Orientation a little ahead, for a loop whose answer arrives late.

With the rate w and its trend a, a low-passed slope, the sensor turns within the horizon h by

    theta = w h + a h^2 / 2,    q(t + h) = q(t) exp(theta).
"""

from collections.abc import Sequence
from dataclasses import dataclass

from gravcomp.config import parameter
from gravcomp.orientation import quaternion as quat


@dataclass(frozen=True)
class PredictionOptions:
    """How far ahead, and how the trend is told from noise."""

    horizon: float = parameter(
        0.0, edge="ms", minimum=0, maximum=500, description="how far ahead gravity is given: the loop's delay"
    )
    trend_time: float = parameter(10.0, edge="ms", minimum=5, maximum=5000, description="low-pass of the rate's slope")
    longest_trend: float = parameter(
        10.0, edge="ms", minimum=0, maximum=500, description="how long the slope is believed to last; the rate lasts the horizon"
    )


class Predictor:
    """Follows the rate by stamps; `ahead` is stateless."""

    def __init__(self, options: PredictionOptions | None = None):
        self.options = options or PredictionOptions()
        self.reset()

    def reset(self) -> None:
        """Forget the trend."""
        self._stamp_ns: int | None = None
        self._rate = (0.0, 0.0, 0.0)
        self._trend = (0.0, 0.0, 0.0)

    def update(self, stamp_ns: int, rate: Sequence[float]) -> None:
        """Take the rate (3,) rad/s at the stamp."""
        if self._stamp_ns is not None and stamp_ns > self._stamp_ns:
            dt = (stamp_ns - self._stamp_ns) * 1e-9
            gain = 1.0 / (self.options.trend_time + dt)  # of a difference, which holds dt already
            self._trend = tuple(t + gain * (r - p - t * dt) for t, r, p in zip(self._trend, rate, self._rate))
        self._stamp_ns = stamp_ns
        self._rate = tuple(rate)

    def ahead(self, orientation: Sequence[float]) -> quat.Quaternion:
        """The orientation (w x y z, sensor to earth) a horizon after the last update."""
        horizon = self.options.horizon
        if horizon == 0.0:
            return tuple(orientation)
        lasting = min(self.options.longest_trend, horizon)
        weight = lasting * (horizon - 0.5 * lasting)
        turn = (r * horizon + t * weight for r, t in zip(self._rate, self._trend))
        return quat.normalised(quat.multiply(orientation, quat.exponential(*turn)))
