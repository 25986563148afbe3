"""Detection of rest, at which the mean rate is the bias.

The sensor is at rest when, for `minimum_time`: every rate and specific force stays near its own low-pass; the mean rate is small
and agrees with the bias where that is known; the mean specific force does not drift. The last two distinguish a bias from a slow,
steady rotation. `calm` is the same without the bias: the sensor may rotate slowly about the vertical, but its specific force is
gravity in any case.
"""

import math
from collections.abc import Sequence

from gravcomp.orientation.options import RestOptions

CONSISTENT_SIGMAS = 4.0  # of the bias: a mean rate that differs more is a rotation
CONSISTENT_FLOOR = math.radians(0.15)  # rad/s


def consistent_within(bias_std: float) -> float:
    """Return the largest difference (rad/s) of a mean rate at rest from a bias with the standard deviation `bias_std` (rad/s)."""
    return CONSISTENT_SIGMAS * bias_std + CONSISTENT_FLOOR


def agrees(mean_gyro: Sequence[float], bias: Sequence[float], bias_std: Sequence[float]) -> bool:
    """Return whether the mean rate (3,) rad/s is that of a sensor at rest with this bias (3,) rad/s."""
    return all(abs(m - b) <= consistent_within(s) for m, b, s in zip(mean_gyro, bias, bias_std))


class RestDetector:
    """Low-passed rate and specific force, and the time for which they have not changed."""

    def __init__(self, options: RestOptions):
        self._options = options
        self.reset()

    def reset(self) -> None:
        """Reset all state."""
        self.mean_gyro: list[float] = []  # rad/s, empty before the first sample
        self.mean_accel: list[float] = []  # m/s^2, as well
        self._reference: list[float] = []
        self._calm_reference: list[float] = []
        self._still = self._calm = 0.0

    def saved(self) -> tuple:
        """Return the state, for `restore`."""
        lists = (self.mean_gyro, self.mean_accel, self._reference, self._calm_reference)
        return *(list(values) for values in lists), self._still, self._calm

    def restore(self, state: tuple) -> None:
        """Set a saved state."""
        self.mean_gyro, self.mean_accel, self._reference, self._calm_reference = (list(values) for values in state[:4])
        self._still, self._calm = state[4:]

    @property
    def resting(self) -> bool:
        """Whether the sensor is at rest."""
        return self._still >= self._options.minimum_time

    @property
    def calm(self) -> bool:
        """Whether the sensor is at rest or rotates slowly about the vertical."""
        return self._calm >= self._options.minimum_time

    def update(
        self, dt: float, gyro: Sequence[float], accel: Sequence[float], bias: Sequence[float], bias_std: Sequence[float]
    ) -> bool:
        """Take a sample `dt` s after the last one and return whether the sensor is at rest.

        gyro (3,) rad/s, accel (3,) m/s^2; bias, bias_std (3,) rad/s: estimate of the filter.
        """
        options = self._options
        if not self.mean_gyro:
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
