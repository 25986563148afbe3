"""The virtual IMU board in Python: samples, heater and status as canbus/FRAMES.md describes them.

It is on the bus of the motors, and their frames pass it. The board's firmware is under the same tests
(`gravcomp.virtual.emulated_board`).
"""

import math

import can
import numpy as np

from gravcomp.canbus.codec import PROTOCOL, encode
from gravcomp.virtual.imu_chip import SAMPLE_PERIOD, ImuChip
from gravcomp.virtual.parameters import Board

STATUS_PERIOD = 0.100  # s
_HEATER_TIMEOUT = 0.5  # s
_SENSOR_TIMEOUT = 1.5  # s
_CUT_OFF, _CUT_ON = 65.0, 60.0  # degC
_FLAG_SILENT_IMU, _FLAG_CUT_OFF, _FLAG_NO_COMMAND = 1, 2, 4
FIRMWARE = (1, 0)


class VirtualBoard:
    """State of the board. Attribute: chip (the IMU, with its faults)."""

    between = False
    """Whether the frames between host and motors pass through the board."""

    def __init__(self, parameters: Board, random: np.random.Generator):
        self._parameters = parameters
        self.chip = ImuChip(parameters, random)
        self.restart()

    @property
    def temperature(self) -> float:
        """True temperature of the chip, degC."""
        return self.chip.temperature

    def restart(self) -> None:
        """Restart as after a loss of supply: time, sequence and heater start again; the chip keeps its temperature."""
        self._time, self._sequence, self._duty, self._commanded, self._since_command = 0.0, 0, 0.0, 0.0, math.inf
        self._over_temperature = False
        self._since_reading = 0.0
        self.chip.restart()

    def command_heater(self, duty: float) -> None:
        """Take a HeaterCommand; duty is limited to 0 to 1."""
        self._commanded, self._since_command = min(1.0, max(0.0, duty)), 0.0

    def sample(self, rate: np.ndarray, force: np.ndarray, recorded: bool) -> list[can.Message]:
        """Advance by one sample period and return the frames that are sent; arguments as of `ImuChip.counts`."""
        self._advance()
        counts = self.chip.counts(rate, force, recorded)
        sequence, self._sequence = self._sequence, (self._sequence + 1) % 256
        if counts is None:
            return []
        self._since_reading = 0.0
        a, g = [int(c) for c in counts[:3]], [int(c) for c in counts[3:]]
        time = int(self._time * (1.0 + self._parameters.clock_error) * 1e6) % 2**32
        return [
            encode("ImuAccelerometer", x=a[0], y=a[1], z=a[2], sequence=sequence),
            encode("ImuGyroscope", x=g[0], y=g[1], z=g[2], sequence=sequence),
            encode("ImuTime", time=time, temperature=self.chip.reading, sequence=sequence),
        ]

    def skip(self, samples: int) -> None:
        """Let the time of `samples` samples pass without sending them."""
        for _ in range(samples):
            self._advance()
        self._since_reading = 0.0
        self._sequence = (self._sequence + samples) % 256

    def status(self) -> can.Message:
        """Return the BoardStatus frame."""
        flags = _FLAG_SILENT_IMU if self.chip.imu_fault == "silent" else 0
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

    def _advance(self) -> None:
        """Let a sample period pass. The board knows the temperature only as the chip reads it."""
        self._time += SAMPLE_PERIOD
        self._since_command += SAMPLE_PERIOD
        self._since_reading += SAMPLE_PERIOD
        self._over_temperature = self.chip.reading > (_CUT_ON if self._over_temperature else _CUT_OFF)
        late = self._since_command > _HEATER_TIMEOUT or self._since_reading > _SENSOR_TIMEOUT
        self._duty = 0.0 if self._over_temperature or late else self._commanded
        self.chip.heat(self._duty)
