"""Telling rest from motion, so that the mean rate can be taken for the bias.

At rest, for `minimum_time`: every rate and specific force stays near its own low-pass; the mean rate is small and,
where the bias is already known, agrees with it; the mean specific force does not drift. The last two tell a slow, steady turn from a bias.
`calm` is the same without the bias: about the vertical it may be such a turn, but the specific force is gravity, whatever is believed.
"""

import math
from collections.abc import Sequence

from gravcomp.orientation.options import RestOptions

CONSISTENT_SIGMAS = 4.0  # of the bias: a mean rate farther away from it is a turn
CONSISTENT_FLOOR = math.radians(0.15)  # rad/s


def consistent_within(bias_std: float) -> float:
    """How far (rad/s) a mean rate at rest may be from a bias that is known to `bias_std` (rad/s)."""
    return CONSISTENT_SIGMAS * bias_std + CONSISTENT_FLOOR


def agrees(mean_gyro: Sequence[float], bias: Sequence[float], bias_std: Sequence[float]) -> bool:
    """Whether the mean rate (3,) rad/s is that of a sensor at rest with this bias."""
    return all(abs(m - b) <= consistent_within(s) for m, b, s in zip(mean_gyro, bias, bias_std))


class RestDetector:
    """Low-passed rate and specific force, and for how long they have been still."""

    def __init__(self, options: RestOptions):
        self._options = options
        self.reset()

    def reset(self) -> None:
        """Forget what was seen."""
        self.mean_gyro: list[float] | None = None  # rad/s
        self.mean_accel: list[float] = []  # m/s^2
        self._reference: list[float] = []
        self._calm_reference: list[float] = []
        self._still = self._calm = 0.0

    @property
    def resting(self) -> bool:
        return self._still >= self._options.minimum_time

    @property
    def calm(self) -> bool:
        return self._calm >= self._options.minimum_time

    def update(
        self, dt: float, gyro: Sequence[float], accel: Sequence[float], bias: Sequence[float], bias_std: Sequence[float]
    ) -> bool:
        """Take one sample; `bias` and its standard deviation (rad/s) are what the filter believes. Returns whether it rests."""
        options = self._options
        if self.mean_gyro is None:
            self.mean_gyro, self.mean_accel = list(gyro), list(accel)
            self._reference, self._calm_reference = list(accel), list(accel)
            return False
        gain = dt / (options.time_constant + dt)
        still = calm = True
        for i in range(3):
            gyro_deviation = gyro[i] - self.mean_gyro[i]
            accel_deviation = accel[i] - self.mean_accel[i]
            self.mean_gyro[i] += gain * gyro_deviation
            self.mean_accel[i] += gain * accel_deviation
            mean = self.mean_gyro[i]
            if (
                abs(gyro_deviation) > options.gyro_deviation
                or abs(accel_deviation) > options.accel_deviation
                or abs(mean) > options.largest_bias
            ):
                still = calm = False
            elif (
                abs(mean - bias[i]) > consistent_within(bias_std[i])
                or abs(self.mean_accel[i] - self._reference[i]) > options.accel_drift
            ):
                still = False
            if abs(self.mean_accel[i] - self._calm_reference[i]) > options.accel_drift:
                calm = False
        if calm:
            self._calm += dt
        else:
            self._calm = 0.0
            self._calm_reference = list(self.mean_accel)
        if still:
            self._still += dt
        else:
            self._still = 0.0
            self._reference = list(self.mean_accel)
        return self.resting
