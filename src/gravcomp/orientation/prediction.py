"""Prediction of the orientation by a lead, for a control loop with latency.

With the rate w and its trend a, a low-passed slope, the sensor rotates within the horizon h by

    theta = w h + a h^2 / 2,    q(t + h) = q(t) exp(theta).
"""

from dataclasses import dataclass

from gravcomp.config import parameter
from gravcomp.orientation import quaternion as quat


@dataclass(frozen=True)
class PredictionOptions:
    """Lead, and low-pass of the trend."""

    horizon: float = parameter(
        0.0, edge="ms", minimum=0, maximum=500, description="lead of the predicted gravity: the latency of the loop"
    )
    trend_time: float = parameter(10.0, edge="ms", minimum=5, maximum=5000, description="low-pass of the rate's slope")
    longest_trend: float = parameter(
        10.0,
        edge="ms",
        minimum=0,
        maximum=500,
        description="time for which the slope is extrapolated; the rate is extrapolated over the horizon",
    )


class Predictor:
    """Follows rate and trend; `ahead` does not change the state."""

    def __init__(self, options: PredictionOptions | None = None):
        self.options = options or PredictionOptions()
        self.reset()

    def reset(self) -> None:
        """Reset the trend."""
        self._stamp_ns: int | None = None
        self._rate = (0.0, 0.0, 0.0)
        self._trend = (0.0, 0.0, 0.0)

    def update(self, stamp_ns: int, rate: quat.Vector) -> None:
        """Take the rate (3,) rad/s at the stamp (ns)."""
        if self._stamp_ns is not None and stamp_ns > self._stamp_ns:
            dt = (stamp_ns - self._stamp_ns) * 1e-9
            gain = 1.0 / (self.options.trend_time + dt)  # of a difference, which already contains dt
            x, y, z = (t + gain * (r - p - t * dt) for t, r, p in zip(self._trend, rate, self._rate))
            self._trend = (x, y, z)
        self._stamp_ns = stamp_ns
        self._rate = rate

    def ahead(self, orientation: quat.Quaternion) -> quat.Quaternion:
        """Return the orientation (w x y z, sensor to earth) one horizon after the last update."""
        horizon = self.options.horizon
        if horizon == 0.0:
            return orientation
        lasting = min(self.options.longest_trend, horizon)
        weight = lasting * (horizon - 0.5 * lasting)
        turn = (r * horizon + t * weight for r, t in zip(self._rate, self._trend))
        return quat.normalised(quat.multiply(orientation, quat.exponential(*turn)))
