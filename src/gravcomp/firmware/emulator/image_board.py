"""The image in the emulator with the methods of `HostBoard`: the same tests run on both."""

from collections.abc import Mapping

import can

from gravcomp.config import ConfigError
from gravcomp.firmware.emulator.can_controller import WireFrame
from gravcomp.firmware.emulator.machine import Machine
from gravcomp.firmware.host_board import HOST_BUS
from gravcomp.firmware.image import Image, build_image
from gravcomp.firmware.settings import keys, word_of

TICK = 1000  # us
_CAUSES = ("power", "supply", "watchdog", "software", "pin")
_IDE, _RTR = 1 << 2, 1 << 1


class ImageBoard:
    """One board. Attribute: machine.

    image: default that without the loop on the board; model: blob of the loop, of an image that has one. Raises SetupError
    without tools, ConfigError for wrong settings.
    """

    def __init__(
        self,
        settings: Mapping[str, float] | None = None,
        unique_id: tuple[int, int, int] = (1, 2, 3),
        image: Image | None = None,
        model: bytes | None = None,
    ):
        self.machine = Machine(image or build_image(standalone=model is not None), unique_id)
        self._now = 0
        if model:
            self.machine.load_model(model)
            self.machine.reset("power")
            self.machine.resets.clear()
            self.machine.resets.append("power")
        self.set(settings or {})

    def restart(self, cause: int = 0) -> None:
        """Start as after a reset of this cause (core/board.h)."""
        self.machine.flash.words_left = None
        self.machine.reset(_CAUSES[cause])
        self._now = 0

    def set(self, settings: Mapping[str, float]) -> None:
        """Set parameters by name, without a request. Raises ConfigError for an unknown name or a value out of range."""
        parameters = self.machine.symbols["board"]
        for name, value in settings.items():
            if not self.machine.call("gc_parameter_set", parameters, keys()[name], word_of(name, value)) & 1:
                raise ConfigError(f"the board's parameter {name} is {value:g}; the firmware does not allow that")

    def word(self, name: str) -> int:
        """Return the 32 bits of a parameter."""
        at = self.machine.symbols["board"] + 4 * keys()[name]
        return int.from_bytes(self.machine.read(at, 4), "little")

    def lose_supply_after(self, words: int) -> None:
        """Let the supply fail after this number of writes to the flash; negative: never."""
        self.machine.flash.words_left = None if words < 0 else words

    def advance(self, now_us: int) -> None:
        """Run all ticks up to `now_us` (us)."""
        while (now_us - self._now) & 0xFFFFFFFF >= TICK and not self.machine.dead:
            resets = len(self.machine.resets)
            self._now = (self._now + TICK) & 0xFFFFFFFF
            self.machine.tick(self._now)
            if len(self.machine.resets) != resets:
                self._now = 0
                return

    def receive(self, message: can.Message, bus: int = HOST_BUS) -> None:
        """Take a frame from a bus."""
        self.machine.receive(bus, [_wire(message)])

    def sample(self, counts: tuple[int, ...], temperature: int, time_us: int) -> None:
        """Let the IMU measure this, with its data-ready edge at `time_us`."""
        self.machine.imu.measure(counts, temperature)
        self.machine.data_ready(time_us)

    def sent(self, bus: int = HOST_BUS) -> list[can.Message]:
        """Return the frames that have left on a bus, in order."""
        if self.machine.is_busy(self._now):
            return []
        frames, self.machine.cans[bus].sent = self.machine.cans[bus].sent, []
        return [can.Message(arbitration_id=f.identifier >> 21, is_extended_id=False, data=f.data[: f.length]) for f in frames]

    def bus_off(self, bus: int, off: bool) -> None:
        """Let a bus be off, or on again."""
        self.machine.cans[bus].short = off

    @property
    def duty(self) -> float:
        """Duty of the heater that the timer has, 0 to 1."""
        return 1e-4 * self.machine.duty

    @property
    def faults(self) -> int:
        """Bits of the present faults."""
        return self.machine.call("gc_board_faults", self.machine.symbols["board"]) & 0xFFFF


def _wire(message: can.Message) -> WireFrame:
    data = bytes(message.data[:8]).ljust(8, b"\0")
    odd = message.is_error_frame or message.is_fd
    identifier = (
        (message.arbitration_id & 0x1FFFFFFF) << 3 | _IDE if message.is_extended_id or odd else message.arbitration_id << 21
    )
    return WireFrame(identifier & 0xFFFFFFFF | (_RTR if message.is_remote_frame else 0), min(message.dlc, 8), data)
