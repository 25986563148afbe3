"""The whole way from raw samples to gravity in the robot's base frame; the node and the offline command both run this.

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
from gravcomp.orientation.calibration import ImuCalibration
from gravcomp.orientation.filter import Estimate, OrientationFilter
from gravcomp.orientation.guard import Problem
from gravcomp.orientation.options import FilterOptions
from gravcomp.orientation.prediction import PredictionOptions, Predictor

# A temperature counts for samples that much younger: whatever order messages arrive in, it has arrived by then.
TEMPERATURE_LAG_NS = 100_000_000
# The temperature stands still when the readings of so long a time differ by one count of the chip at most.
STABLE_TIME_NS = 20_000_000_000
STABLE_SPAN = 0.13  # degC
LEARN_EVERY = 1.0  # s at rest between two entries of the bias model


@dataclass(frozen=True)
class EstimatorOptions:
    """Everything that the result depends on."""

    filter: FilterOptions = field(default_factory=FilterOptions)
    calibration: ImuCalibration = field(default_factory=ImuCalibration)
    prediction: PredictionOptions = field(default_factory=PredictionOptions)


@dataclass(frozen=True, slots=True)
class GravityEstimate:
    """An Estimate and what the robot needs of it."""

    imu: Estimate  # bias without the calibration's offset and the bias model's part
    gravity: tuple[float, float, float]  # m/s^2, soft_base, a horizon ahead of the stamp
    bias: tuple[float, float, float]  # rad/s, the whole bias of the raw rate
    accel: tuple[float, float, float]  # m/s^2, calibrated specific force, IMU frame
    calibrated: bool  # |a| at rest is gravity, as far as is known


class GravityEstimator:
    """Takes samples and temperatures by stamp. Fed with the same values it gives the same results, bit for bit."""

    def __init__(
        self,
        options: EstimatorOptions | None = None,
        mount: Sequence[float] = quat.IDENTITY,
        bias_model: BiasTemperatureModel | None = None,
    ):
        """`mount`: w x y z, IMU to soft_base. `bias_model` is read, never changed; what this run shows collects in `learned`."""
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
        self._span = (-math.inf, math.inf, 0)  # lowest and highest reading, degC, since a stamp, ns; at first too wide
        self._compensation = self._gyro_offset
        self.reset()

    def reset(self) -> None:
        """Begin anew: yaw 0, no bias; the temperature and what is known of the bias over it stay."""
        self.filter.reset()
        if self._temperature is not None and self._model is not None and self._model.span is not None:
            self.filter.reset_bias(std=RESIDUAL_STD)
        self._predictor.reset()
        self._rested = 0.0
        self._last_ns: int | None = None

    @property
    def bias_estimation(self) -> bool:
        """Whether the filter estimates the bias; may be switched while running."""
        return self.filter.bias_estimation

    @bias_estimation.setter
    def bias_estimation(self, on: bool) -> None:
        self.filter.set_bias_estimation(on)

    def set_prediction(self, options: PredictionOptions) -> None:
        """Change the prediction while running; the orientation goes on unbroken."""
        self._predictor.options = options

    def add_temperature(self, stamp_ns: int, temperature: float) -> None:
        """Take a temperature reading, degC; it counts for samples 0.1 s younger and more."""
        if math.isfinite(temperature):
            self._temperatures.append((stamp_ns, float(temperature)))

    def update(self, stamp_ns: int, gyro: Sequence[float], accel: Sequence[float]) -> GravityEstimate | Problem:
        """Take a raw sample, gyro (3,) rad/s and accel (3,) m/s^2 in the IMU's frame; the Problem alone: it cannot be used."""
        self._follow_temperature(stamp_ns)
        compensation, offset, scale = self._compensation, self._offset, self._scale
        accel = (scale[0] * (accel[0] - offset[0]), scale[1] * (accel[1] - offset[1]), scale[2] * (accel[2] - offset[2]))
        rate = (gyro[0] - compensation[0], gyro[1] - compensation[1], gyro[2] - compensation[2])
        estimate = self.filter.update(stamp_ns, rate, accel)
        if isinstance(estimate, Problem):
            return estimate
        if estimate.problem is Problem.CLOCK_RESTARTED:
            self._temperatures.clear()
        bias = tuple(b + c for b, c in zip(estimate.bias, compensation))
        self._learn(estimate, bias)

        self._predictor.update(stamp_ns, estimate.angular_velocity)
        ahead = self._predictor.ahead(estimate.orientation)
        gravity = quat.rotate(quat.conjugate(ahead), (0.0, 0.0, -self.options.filter.gravity))
        norm = estimate.accel_norm_at_rest
        return GravityEstimate(
            imu=estimate,
            gravity=quat.rotate(self._mount, gravity),
            bias=bias,
            accel=accel,
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
                self._compensation = tuple(o + float(m) for o, m in zip(self._gyro_offset, modelled))
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

    def _learn(self, estimate: Estimate, bias: tuple) -> None:
        dt = 0.0 if self._last_ns is None else (estimate.stamp_ns - self._last_ns) * 1e-9
        self._last_ns = estimate.stamp_ns
        if not estimate.rest or not self.bias_estimation or self._temperature is None:
            self._rested = 0.0
            return
        self._rested += dt
        if self._rested >= LEARN_EVERY:
            self.learned.learn(self._temperature, np.subtract(bias, self._gyro_offset), self._rested)
            self._rested = 0.0
