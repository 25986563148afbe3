"""Raw IMU samples to gravity in the frame of the robot's base; the node and the offline command both use this.

    calibration -> bias over temperature -> orientation filter -> prediction -> mounting rotation

gravity in soft_base = R_mount R(q)^T (0, 0, -g).
"""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from gravcomp.orientation import quaternion as quat
from gravcomp.orientation.bias_model import RESIDUAL_STD, BiasTemperatureModel
from gravcomp.orientation.estimate import Estimate
from gravcomp.orientation.filter import OrientationFilter
from gravcomp.orientation.guard import Problem
from gravcomp.orientation.imu_calibration import ImuCalibration
from gravcomp.orientation.options import FilterOptions
from gravcomp.orientation.prediction import PredictionOptions, Predictor

# A temperature counts for samples later than it by this time; by then it has arrived, in any order of the messages.
TEMPERATURE_LAG_NS = 100_000_000
# The temperature is stable when its readings over this time differ by at most one count of the chip.
STABLE_TIME_NS = 20_000_000_000
STABLE_SPAN = 0.13  # degC
LEARN_EVERY = 1.0  # s at rest between two entries of the bias model


@dataclass(frozen=True)
class EstimatorOptions:
    """All parameters that the result depends on."""

    filter: FilterOptions = field(default_factory=FilterOptions)
    calibration: ImuCalibration = field(default_factory=ImuCalibration)
    prediction: PredictionOptions = field(default_factory=PredictionOptions)


@dataclass(frozen=True, slots=True)
class GravityEstimate:
    """An Estimate, and gravity in the frame of the robot's base."""

    imu: Estimate  # its bias is without the calibration's offset and the bias model's part
    gravity: quat.Vector  # m/s^2, soft_base, one horizon after the stamp
    bias: quat.Vector  # rad/s, the whole bias of the raw rate
    accel: quat.Vector  # m/s^2, calibrated specific force, IMU frame
    calibrated: bool  # |a| at rest is gravity, or is not known yet


class GravityEstimator:
    """Takes samples and temperatures by stamp. The same values give the same results, bit for bit."""

    def __init__(
        self,
        options: EstimatorOptions | None = None,
        mount: Sequence[float] = quat.IDENTITY,
        bias_model: BiasTemperatureModel | None = None,
    ):
        """`mount`: w x y z, IMU to soft_base. `bias_model` is not changed; `learned` collects what this run learns."""
        self.options = options or EstimatorOptions()
        self.filter = OrientationFilter(self.options.filter)
        self.learned = BiasTemperatureModel()
        self._model = bias_model
        self._predictor = Predictor(self.options.prediction)
        calibration = self.options.calibration
        self._scale, self._offset, self._gyro_offset = calibration.accel_scale, calibration.accel_offset, calibration.gyro_offset
        self._mount = quat.normalised(mount)
        self._temperatures: deque[tuple[int, float]] = deque(maxlen=1000)
        self._temperature: float | None = None
        self._span = (-math.inf, math.inf, 0)  # lowest and highest reading, degC, since a stamp, ns; at first wider than any span
        self._compensation = self._gyro_offset
        self.reset()

    def reset(self) -> None:
        """Start again with yaw 0 and no bias; temperature and bias model stay."""
        self.filter.reset()
        if self._temperature is not None and self._model is not None and self._model.span is not None:
            self.filter.reset_bias(std=RESIDUAL_STD)
        self._predictor.reset()
        self._rested = 0.0
        self._last_ns: int | None = None

    @property
    def bias_estimation(self) -> bool:
        """Whether the filter estimates the bias; can be switched while running."""
        return self.filter.bias_estimation

    @bias_estimation.setter
    def bias_estimation(self, on: bool) -> None:
        self.filter.set_bias_estimation(on)

    def set_prediction(self, options: PredictionOptions) -> None:
        """Change the prediction while running; the orientation is not affected."""
        self._predictor.options = options

    def add_temperature(self, stamp_ns: int, temperature: float) -> None:
        """Take a temperature reading, degC; it counts for samples at least 0.1 s later."""
        if math.isfinite(temperature):
            self._temperatures.append((stamp_ns, float(temperature)))

    def update(
        self, stamp_ns: int, gyro: Sequence[float], accel: Sequence[float], known: Sequence[float] = (0.0, 0.0, 0.0)
    ) -> GravityEstimate | Problem:
        """Take a raw sample and return the estimate, or only the Problem when the sample cannot be used.

        stamp_ns: ns; gyro (3,) rad/s and accel (3,) m/s^2 in the IMU's frame. known (3,) m/s^2 in soft_base: the acceleration of
        the IMU that somebody else knows, such as the arm that carries it; the filter takes the specific force without it.
        """
        self._follow_temperature(stamp_ns)
        compensation, offset, scale = self._compensation, self._offset, self._scale
        force = (scale[0] * (accel[0] - offset[0]), scale[1] * (accel[1] - offset[1]), scale[2] * (accel[2] - offset[2]))
        rate = (gyro[0] - compensation[0], gyro[1] - compensation[1], gyro[2] - compensation[2])
        kx, ky, kz = quat.rotate(quat.conjugate(self._mount), known)
        estimate = self.filter.update(stamp_ns, rate, (force[0] - kx, force[1] - ky, force[2] - kz))
        if isinstance(estimate, Problem):
            return estimate
        if estimate.problem is Problem.CLOCK_RESTARTED:
            self._temperatures.clear()
        bx, by, bz = estimate.bias
        bias = (bx + compensation[0], by + compensation[1], bz + compensation[2])
        self._learn(estimate, bias)

        self._predictor.update(stamp_ns, estimate.angular_velocity)
        ahead = self._predictor.ahead(estimate.orientation)
        gravity = quat.rotate(quat.conjugate(ahead), (0.0, 0.0, -self.options.filter.gravity))
        norm = estimate.accel_norm_at_rest
        return GravityEstimate(
            imu=estimate,
            gravity=quat.rotate(self._mount, gravity),
            bias=bias,
            accel=force,
            calibrated=norm is None or abs(norm - self.options.filter.gravity) <= self.options.calibration.norm_tolerance,
        )

    def _follow_temperature(self, stamp_ns: int) -> None:
        newest = None
        while self._temperatures and self._temperatures[0][0] <= stamp_ns - TEMPERATURE_LAG_NS:
            taken_ns, newest = self._temperatures.popleft()
            self._watch_stability(taken_ns, newest)
        if newest is not None and newest != self._temperature:
            first = self._temperature is None
            self._temperature = newest
            modelled = self._model.bias(newest) if self._model is not None else None
            if modelled is not None:
                x, y, z = (o + float(m) for o, m in zip(self._gyro_offset, modelled))
                self._compensation = (x, y, z)
                if first:
                    self.filter.reset_bias(std=RESIDUAL_STD)

    def _watch_stability(self, stamp_ns: int, temperature: float) -> None:
        lowest, highest, since_ns = self._span
        lowest, highest = min(lowest, temperature), max(highest, temperature)
        if not highest - lowest <= STABLE_SPAN or stamp_ns < since_ns:
            lowest = highest = temperature
            since_ns = stamp_ns
        self._span = (lowest, highest, since_ns)
        self.filter.temperature_stable = stamp_ns - since_ns >= STABLE_TIME_NS

    def _learn(self, estimate: Estimate, bias: quat.Vector) -> None:
        dt = 0.0 if self._last_ns is None else (estimate.stamp_ns - self._last_ns) * 1e-9
        self._last_ns = estimate.stamp_ns
        if not estimate.rest or not self.bias_estimation or self._temperature is None:
            self._rested = 0.0
            return
        self._rested += dt
        if self._rested >= LEARN_EVERY:
            self.learned.learn(self._temperature, np.subtract(bias, self._gyro_offset), self._rested)
            self._rested = 0.0
