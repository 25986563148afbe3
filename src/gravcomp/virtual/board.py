"""The virtual IMU board: an IMU with its errors, the heater, and the frames that the board sends (canbus/FRAMES.md).

    counts = round(((1 + s) C^T x + b + d (T - 25 degC) + noise) / scale), limited to int16

x is the specific force or the angular rate in imu_link, C a small misalignment, T the temperature of the chip; s, b and d are
drawn once with the seed. A sample from a recording is quantised only, because it contains its own errors.
"""

import math

import can
import numpy as np

from gravcomp.canbus.codec import PROTOCOL, encode
from gravcomp.canbus.imu_scales import accelerometer_scale, gyroscope_scale
from gravcomp.standard_gravity import STANDARD_GRAVITY
from gravcomp.thermal.plant import ThermalPlant
from gravcomp.virtual.motion import turned
from gravcomp.virtual.parameters import Board

SAMPLE_PERIOD = 0.010  # s
STATUS_PERIOD = 0.100  # s
_HEATER_TIMEOUT = 0.5  # s
_CUT_OFF, _CUT_ON = 65.0, 60.0  # degC
_FLAG_SILENT_IMU, _FLAG_CUT_OFF, _FLAG_NO_COMMAND = 1, 2, 4
_REFERENCE_TEMPERATURE = 25.0  # degC
FIRMWARE = (1, 0)


class VirtualBoard:
    """State of the board.

    Its faults are attributes: `imu_fault` is None, 'stuck', 'saturated', 'invalid' or 'silent'; `heater_fault` is None, 'dead' or
    'stuck_on'; `temperature_stuck` is True while the temperature reading does not change.
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
        """Restart as after a loss of supply: time, sequence and heater start again; the chip keeps its temperature."""
        self._time, self._sequence, self._duty, self._commanded, self._since_command = 0.0, 0, 0.0, 0.0, math.inf
        self._over_temperature = False
        self._counts = np.zeros(6, dtype=np.int64)
        self._reading = self._plant.reading

    def command_heater(self, duty: float) -> None:
        """Take a HeaterCommand; duty is limited to 0 to 1."""
        self._commanded, self._since_command = min(1.0, max(0.0, duty)), 0.0

    def sample(self, rate: np.ndarray, force: np.ndarray, recorded: bool) -> list[can.Message]:
        """Advance by one sample period and return the frames of the sample.

        rate (3,) rad/s and force (3,) m/s^2, the specific force, are in imu_link; `recorded`: they are measured values, not true
        ones.
        """
        self._time += SAMPLE_PERIOD
        self._since_command += SAMPLE_PERIOD
        self._heat()
        if self.imu_fault != "stuck":
            self._counts = self._measure(rate, force, recorded)
        counts = self._counts
        if self.imu_fault == "saturated":
            counts = np.array([32767, -32768, 32767] * 2)
        elif self.imu_fault == "invalid":
            counts = np.full(6, -32768)
        if not self.temperature_stuck:
            self._reading = self._plant.reading
        sequence, self._sequence = self._sequence, (self._sequence + 1) % 256
        if self.imu_fault == "silent":
            return []
        a, g = [int(c) for c in counts[:3]], [int(c) for c in counts[3:]]
        time = int(self._time * (1.0 + self._parameters.clock_error) * 1e6) % 2**32
        return [
            encode("ImuAccelerometer", x=a[0], y=a[1], z=a[2], sequence=sequence),
            encode("ImuGyroscope", x=g[0], y=g[1], z=g[2], sequence=sequence),
            encode("ImuTime", time=time, temperature=self._reading, sequence=sequence),
        ]

    def skip(self, samples: int) -> None:
        """Let the time of `samples` samples pass without sending them."""
        for _ in range(samples):
            self._time += SAMPLE_PERIOD
            self._since_command += SAMPLE_PERIOD
            self._heat()
        self._sequence = (self._sequence + samples) % 256

    def status(self) -> can.Message:
        """Return the BoardStatus frame."""
        flags = _FLAG_SILENT_IMU if self.imu_fault == "silent" else 0
        flags |= _FLAG_CUT_OFF if self._over_temperature else 0
        flags |= _FLAG_NO_COMMAND if self._since_command > _HEATER_TIMEOUT else 0
        return encode(
            "BoardStatus",
            protocol=PROTOCOL,
            firmware_major=FIRMWARE[0],
            firmware_minor=FIRMWARE[1],
            heater_duty=self._duty,
            flags=flags,
            accelerometer_range=self._parameters.accelerometer_range,
            gyroscope_range=self._parameters.gyroscope_range,
        )

    def _heat(self) -> None:
        temperature = self._plant.temperature
        self._over_temperature = temperature > (_CUT_ON if self._over_temperature else _CUT_OFF)
        off = self._over_temperature or self._since_command > _HEATER_TIMEOUT
        self._duty = 0.0 if off else self._commanded
        effective = {None: self._duty, "dead": 0.0, "stuck_on": 1.0}[self.heater_fault]
        self._plant.step(SAMPLE_PERIOD, effective)

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
