"""The virtual board whose frames come from the firmware's own C code (`gravcomp.firmware`); its IMU is that of `VirtualBoard`.

The board sits between the host and the motors of its bus: it limits currents, holds and releases the cables when the host dies.
With a model it has the loop on the board as well, which the host's request `run` starts. The cables' zero positions are then
known from the start, as after homing: there they are where the straight robot has them.
"""

import can
import numpy as np

from gravcomp.canbus import c610
from gravcomp.canbus.codec import encode
from gravcomp.description.hardware import Hardware
from gravcomp.firmware import requests
from gravcomp.firmware.host_board import HOST_BUS, MOTOR_BUS, HostBoard
from gravcomp.firmware.settings import settings_of
from gravcomp.virtual.imu_chip import SAMPLE_PERIOD, ImuChip
from gravcomp.virtual.parameters import Board

LOOP_FRAMES = range(0x328, 0x330)
"""Ids of the frames to the loop on the board (canbus/FRAMES.md)."""

_STATUS = 0x313
_COUNTS_PER_DEGREE, _ZERO_DEGREES = 8.0, 23.0


class EmulatedBoard:
    """State of the board. Attribute: chip (the IMU, with its faults).

    hardware: its motors' parameters; None: a board for the IMU alone; model: blob of the loop on the board; None: without the
    loop. Raises SetupError without a C compiler.
    """

    def __init__(
        self,
        parameters: Board,
        random: np.random.Generator,
        hardware: Hardware | None = None,
        model: bytes | None = None,
    ):
        self._parameters = parameters
        self.chip = ImuChip(parameters, random)
        self.between = hardware is not None
        self._settings = settings_of(hardware, between=True) if hardware else {}
        self._settings |= {
            "accelerometer_range": parameters.accelerometer_range,
            "gyroscope_range": parameters.gyroscope_range,
        }
        self._board = HostBoard(model=model)
        self._without_zero = {m.can_id for m in hardware.motors} if hardware and model is not None else set()
        self._time = 0.0
        self._last: dict[int, can.Message] = {}  # currents and feedback by id, which continue while time is skipped
        self.restart()

    @property
    def temperature(self) -> float:
        """True temperature of the chip, degC."""
        return self.chip.temperature

    @property
    def firmware(self) -> HostBoard:
        """The C code, with its state and faults."""
        return self._board

    def restart(self) -> None:
        """Restart as after a loss of supply: time, sequence and heater start again; the chip keeps its temperature."""
        self._start = self._sampled = self._time
        self._status: can.Message | None = None
        self._board.restart()
        self._board.set(self._settings)
        self.chip.restart()

    def receive(self, message: can.Message) -> None:
        """Take a frame of the host."""
        if message.arbitration_id in c610.COMMAND_IDS:
            self._last[message.arbitration_id] = message
        self._board.receive(message, HOST_BUS)

    def feedback(self, messages: list[can.Message]) -> None:
        """Take the frames of the motors."""
        for message in messages:
            self._last[message.arbitration_id] = message
            self._board.receive(message, MOTOR_BUS if self.between else HOST_BUS)
            motor = c610.motor_of(message.arbitration_id)
            if motor in self._without_zero:
                self._without_zero.remove(motor)
                self.receive(requests.request("zero", motor - 1))

    def command_heater(self, duty: float) -> None:
        """Take a HeaterCommand."""
        self.receive(encode("HeaterCommand", duty=duty, sequence=0))

    def advance(self, time: float) -> None:
        """Let the firmware run until `time` (s)."""
        self._time = max(time, self._time)
        self._board.advance(self._board_time(self._time))

    def sample(self, rate: np.ndarray, force: np.ndarray, recorded: bool) -> list[can.Message]:
        """Advance by a sample period and return the frames to the host; arguments as of `ImuChip.counts`."""
        self.advance(self._sampled + SAMPLE_PERIOD)
        self._sampled = self._time
        self.chip.heat(self._board.duty)
        counts = self.chip.counts(rate, force, recorded)
        if counts is not None:
            temperature = round((self.chip.reading - _ZERO_DEGREES) * _COUNTS_PER_DEGREE)
            self._board.sample(tuple(counts.tolist()), temperature, self._board_time(self._time))
        return self.to_host()

    def skip(self, samples: int) -> None:
        """Let the time of `samples` samples pass without sending them; host and motors continue as before."""
        for _ in range(samples):
            self.sample(np.zeros(3), np.zeros(3), True)
            self.to_motors()
            for number, message in list(self._last.items()):
                own = number in c610.COMMAND_IDS or not self.between
                self._board.receive(message, HOST_BUS if own else MOTOR_BUS)

    def to_host(self) -> list[can.Message]:
        """Return the frames that the board has sent to the host since the last call."""
        frames = self._board.sent(HOST_BUS)
        self._status = next((f for f in reversed(frames) if f.arbitration_id == _STATUS), self._status)
        return frames

    def to_motors(self) -> list[can.Message]:
        """Return the frames that the board has sent to the motors since the last call."""
        return self._board.sent(MOTOR_BUS)

    def status(self) -> can.Message:
        """Return the last BoardStatus frame. Raises ValueError before the first one."""
        if self._status is None:
            raise ValueError("the board has not sent its status yet")
        return self._status

    def _board_time(self, time: float) -> int:
        return int((time - self._start) * (1.0 + self._parameters.clock_error) * 1e6)
