"""Checks of a sample before the filter takes it: stamps, values, and sensors whose values no longer change."""

import math
from dataclasses import dataclass
from enum import Enum

from gravcomp.orientation.options import SensorOptions
from gravcomp.orientation.quaternion import Vector

SATURATED_FROM = 0.995  # of full scale
RESTART_AFTER = 10  # samples in a row, older than the newest: the clock was set back, a new stream begins


class Problem(Enum):
    """Problem of a sample; the value is the text for the user."""

    NONE = ""
    NOT_FINITE = "the sample holds NaN or infinity"
    OUT_OF_RANGE = "the sample is beyond the sensor's range: a wrong unit (rad/s and m/s^2 are needed) or a wrong range"
    REPEATED_STAMP = "the stamp repeats the previous one"
    REORDERED_STAMP = "the stamp is older than the previous one"
    CLOCK_RESTARTED = "the clock of the stamps was set back: restarted"
    GAP = "samples are missing: the inclination is restarted"
    CONTRADICTED = "the sensor at rest contradicts the inclination: restarted"
    GYRO_SATURATED = "the gyroscope is saturated"
    ACCEL_SATURATED = "the accelerometer is saturated"
    GYRO_STUCK = "the gyroscope is stuck: it repeats the same values"
    ACCEL_STUCK = "the accelerometer is stuck: it repeats the same values"
    STUCK = "the sensor is stuck: it repeats the same values"


REJECTED = frozenset({Problem.NOT_FINITE, Problem.OUT_OF_RANGE, Problem.REPEATED_STAMP, Problem.REORDERED_STAMP})
RESTARTED = frozenset({Problem.CLOCK_RESTARTED, Problem.GAP})


@dataclass(frozen=True, slots=True)
class Verdict:
    """Result of the checks. `problem` in REJECTED: the sample must not be used; in RESTARTED: the filter starts again with it."""

    problem: Problem
    dt: float = 0.0  # s since the last sample taken; 0 for the first
    gyro_saturated: bool = False
    accel_saturated: bool = False
    gyro_stuck: bool = False  # for `stuck_time`; a simulated sensor without noise looks the same
    accel_stuck: bool = False


class SampleGuard:
    """Checks one sample after the other."""

    def __init__(self, options: SensorOptions):
        self._options = options
        self.reset()

    def reset(self) -> None:
        """Reset the stream: the next sample is the first."""
        self._stamp_ns: int | None = None
        self._older = 0
        self._older_ns = 0
        self._gyro: Vector = (math.nan, math.nan, math.nan)
        self._accel: Vector = (math.nan, math.nan, math.nan)
        self._gyro_same = self._accel_same = 0.0

    def check(self, stamp_ns: int, gyro: Vector, accel: Vector) -> Verdict:
        """Check the sample with the stamp in ns; gyro in rad/s, accel in m/s^2."""
        options = self._options
        if not all(map(math.isfinite, gyro)) or not all(map(math.isfinite, accel)):
            return Verdict(Problem.NOT_FINITE)
        largest_gyro, largest_accel = max(map(abs, gyro)), max(map(abs, accel))
        if largest_gyro > 1.01 * options.gyro_range or largest_accel > 1.01 * options.accel_range:
            return Verdict(Problem.OUT_OF_RANGE)

        problem = Problem.NONE
        if self._stamp_ns is None:
            dt = 0.0
        else:
            step = stamp_ns - self._stamp_ns
            if step <= 0:
                problem = self._backward(stamp_ns)
                if problem is not Problem.CLOCK_RESTARTED:
                    return Verdict(problem)
                step = 0
            dt = step * 1e-9
            if dt > options.largest_gap:
                problem = Problem.GAP
        self._older = 0
        self._stamp_ns = stamp_ns

        self._gyro_same = self._gyro_same + dt if gyro == self._gyro else 0.0
        self._accel_same = self._accel_same + dt if accel == self._accel else 0.0
        self._gyro, self._accel = gyro, accel
        gyro_stuck = self._gyro_same >= options.stuck_time
        accel_stuck = self._accel_same >= options.stuck_time
        gyro_saturated = largest_gyro >= SATURATED_FROM * options.gyro_range
        accel_saturated = largest_accel >= SATURATED_FROM * options.accel_range
        if problem is Problem.NONE:
            if gyro_stuck or accel_stuck:
                problem = (
                    Problem.STUCK if gyro_stuck and accel_stuck else Problem.GYRO_STUCK if gyro_stuck else Problem.ACCEL_STUCK
                )
            elif gyro_saturated or accel_saturated:
                problem = Problem.GYRO_SATURATED if gyro_saturated else Problem.ACCEL_SATURATED
        return Verdict(problem, dt, gyro_saturated, accel_saturated, gyro_stuck, accel_stuck)

    def _backward(self, stamp_ns: int) -> Problem:
        if stamp_ns == self._stamp_ns:
            return Problem.REPEATED_STAMP
        # After the clock was set back the stamps advance; those of single late samples do not.
        self._older = self._older + 1 if self._older and stamp_ns > self._older_ns else 1
        self._older_ns = stamp_ns
        return Problem.CLOCK_RESTARTED if self._older >= RESTART_AFTER else Problem.REORDERED_STAMP
