"""The IMU of the virtual board: its errors, its temperature and what it reads of that, its faults.

    counts = round(((1 + s) C^T x + b + d (T - 25 degC) + noise) / scale), limited to int16

x is the specific force or the angular rate in imu_link, C a small misalignment, T the temperature of the chip; s, b and d are
drawn once with the seed. A sample from a recording is quantised only, because it contains its own errors.
"""

import math

import numpy as np

from gravcomp.canbus.imu_scales import accelerometer_scale, gyroscope_scale
from gravcomp.standard_gravity import STANDARD_GRAVITY
from gravcomp.thermal.plant import ThermalPlant
from gravcomp.virtual.motion import turned
from gravcomp.virtual.parameters import Board

SAMPLE_PERIOD = 0.010  # s
_REFERENCE_TEMPERATURE = 25.0  # degC


class ImuChip:
    """State of the chip, sampled every SAMPLE_PERIOD.

    Its faults are attributes: `imu_fault` is None, 'stuck', 'saturated', 'invalid' or 'silent'; `heater_fault` is None, 'dead' or
    'stuck_on'; `temperature_stuck` is True while the temperature reading does not change. Attribute: reading (degC).
    """

    def __init__(self, parameters: Board, random: np.random.Generator):
        self._parameters, self._random = parameters, random
        axes, sign = 3, lambda: random.choice([-1.0, 1.0], 3)
        self._force_bias = parameters.accelerometer_bias * STANDARD_GRAVITY * random.standard_normal(axes)
        self._force_scale = 1.0 + parameters.accelerometer_scale * random.standard_normal(axes)
        self._force_drift = parameters.accelerometer_drift * STANDARD_GRAVITY * sign()
        self._rate_bias = parameters.gyroscope_bias * random.standard_normal(axes)
        self._rate_drift = parameters.gyroscope_drift * sign()
        self._misalignment = turned(parameters.mount_error * _direction(random))
        self._plant = ThermalPlant(parameters.thermal)
        self.imu_fault: str | None = None
        self.heater_fault: str | None = None
        self.temperature_stuck = False
        self.restart()

    @property
    def temperature(self) -> float:
        """True temperature of the chip, degC."""
        return self._plant.temperature

    def restart(self) -> None:
        """Restart as after a loss of supply; the chip keeps its temperature."""
        self._counts = np.zeros(6, dtype=np.int64)
        self.reading = self._plant.reading

    def heat(self, duty: float) -> None:
        """Let a sample period pass with this duty of the heater."""
        effective = {None: duty, "dead": 0.0, "stuck_on": 1.0}[self.heater_fault]
        self._plant.step(SAMPLE_PERIOD, effective)
        if not self.temperature_stuck:
            self.reading = self._plant.reading

    def counts(self, rate: np.ndarray, force: np.ndarray, recorded: bool) -> np.ndarray | None:
        """Return the counts (6,) of accelerometer and gyroscope, None where the chip does not answer.

        rate (3,) rad/s and force (3,) m/s^2, the specific force, are in imu_link; `recorded`: they are measured values, not true
        ones.
        """
        if self.imu_fault != "stuck":
            self._counts = self._measure(rate, force, recorded)
        if self.imu_fault == "silent":
            return None
        if self.imu_fault == "saturated":
            return np.array([32767, -32768, 32767] * 2)
        if self.imu_fault == "invalid":
            return np.full(6, -32768)
        return self._counts

    def _measure(self, rate: np.ndarray, force: np.ndarray, recorded: bool) -> np.ndarray:
        p = self._parameters
        if not recorded:
            warmer = self._plant.temperature - _REFERENCE_TEMPERATURE
            spread = math.sqrt(p.bandwidth)
            noise = self._random.standard_normal(9)
            self._rate_bias = self._rate_bias + p.gyroscope_walk * math.sqrt(SAMPLE_PERIOD) * noise[6:]
            force = self._force_scale * (self._misalignment.T @ force) + self._force_bias + self._force_drift * warmer
            force = force + p.accelerometer_noise * STANDARD_GRAVITY * spread * noise[:3]
            rate = (
                self._misalignment.T @ rate
                + self._rate_bias
                + self._rate_drift * warmer
                + p.gyroscope_noise * spread * noise[3:6]
            )
        counts = np.concatenate([force / accelerometer_scale(p.accelerometer_range), rate / gyroscope_scale(p.gyroscope_range)])
        return np.clip(np.rint(counts), -32768, 32767).astype(np.int64)


def _direction(random: np.random.Generator) -> np.ndarray:
    vector = random.standard_normal(3)
    return vector / np.linalg.norm(vector)
