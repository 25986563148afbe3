"""The board's C code in this process: frames and samples in, frames and heater duty out; time advances only by `advance`."""

import ctypes
from collections.abc import Mapping

import can

from gravcomp.config import ConfigError
from gravcomp.firmware.host_library import Frame, load
from gravcomp.firmware.settings import keys, word_of
from gravcomp.firmware.standalone_loop import LoopResult, RawResult

HOST_BUS, MOTOR_BUS = 0, 1
"""Numbers of the board's buses; the second carries frames only where the board sits between host and motors."""

_ALL_WORDS = 0xFFFFFFFF


class HostBoard:
    """One board. Its stored parameters and models outlive `restart`.

    `unique_id`: three words, as burnt into the chip; model: blob of the loop on the board, empty: firmware with the loop and
    without a model, None: without the loop. Raises SetupError without a compiler, ConfigError for wrong settings.
    """

    def __init__(
        self,
        settings: Mapping[str, float] | None = None,
        unique_id: tuple[int, int, int] = (1, 2, 3),
        model: bytes | None = None,
    ):
        self._unique_id = (ctypes.c_uint32 * 3)(*unique_id)
        self._allocate(model is not None)
        self._library.gc_host_attach(self._at, self._loop_at)
        if model is not None:
            self._library.gc_host_put_model(self._at, model, len(model))
        self.lose_supply_after(_ALL_WORDS)
        self.restart()
        self.set(settings or {})

    def _allocate(self, loop: bool) -> None:
        self._library = load()
        self._memory = (ctypes.c_uint64 * (self._library.gc_host_size() // 8 + 1))()
        self._at = ctypes.addressof(self._memory)
        self._loop = (ctypes.c_uint64 * (self._library.gc_host_loop_size() // 8 + 1))() if loop else None
        self._loop_at = None if self._loop is None else ctypes.addressof(self._loop)
        self._frame = Frame()

    def __deepcopy__(self, memo: dict) -> "HostBoard":
        """Return a board in the same state."""
        other = HostBoard.__new__(HostBoard)
        other._unique_id = (ctypes.c_uint32 * 3)(*self._unique_id)
        other._allocate(self._loop is not None)
        ctypes.memmove(other._at, self._at, ctypes.sizeof(self._memory))
        if self._loop is not None and other._loop is not None:
            ctypes.memmove(other._loop, self._loop, ctypes.sizeof(self._loop))
        other._library.gc_host_attach(other._at, other._loop_at)
        return other

    def restart(self, cause: int = 0) -> None:
        """Start as after a reset of this cause (core/board.h)."""
        self._library.gc_host_start(self._at, self._unique_id, cause)

    def set(self, settings: Mapping[str, float]) -> None:
        """Set parameters by name, without a request. Raises ConfigError for an unknown name or a value out of range."""
        for name, value in settings.items():
            if not self._library.gc_host_set(self._at, keys()[name], word_of(name, value)):
                raise ConfigError(f"the board's parameter {name} is {value:g}; the firmware does not allow that")

    def word(self, name: str) -> int:
        """Return the 32 bits of a parameter."""
        return self._library.gc_host_get(self._at, keys()[name])

    def lose_supply_after(self, words: int) -> None:
        """Let writing to the stored parameters fail after this number of words; negative: never."""
        self._library.gc_host_lose_supply_after(self._at, words & _ALL_WORDS)

    def advance(self, now_us: int) -> None:
        """Run all ticks up to `now_us` (us, wraps at 2^32)."""
        self._library.gc_host_advance(self._at, now_us & 0xFFFFFFFF)

    def receive(self, message: can.Message, bus: int = HOST_BUS) -> None:
        """Take a frame from a bus."""
        odd = message.is_extended_id or message.is_remote_frame or message.is_error_frame or message.is_fd
        self.receive_raw(message.arbitration_id & 0x7FF, message.dlc & 0xFF, bytes(message.data[:8]), bus, odd=odd)

    def receive_raw(self, number: int, length: int, data: bytes, bus: int = HOST_BUS, *, odd: bool = False) -> None:
        """Take a frame by its id, length and bytes; `odd`: it is no standard data frame."""
        frame = self._frame
        frame.id, frame.length, frame.extended = number, length, odd
        ctypes.memmove(frame.data, data.ljust(8, b"\0"), 8)
        self._library.gc_host_receive(self._at, bus, frame)

    def sample(self, counts: tuple[int, ...], temperature: int, time_us: int) -> None:
        """Take a sample: six counts (accelerometer, gyroscope), temperature (counts of 0.125 degC from 23 degC), stamp."""
        self._library.gc_host_sample(self._at, (ctypes.c_int16 * 6)(*counts), temperature, time_us & 0xFFFFFFFF)

    def sent(self, bus: int = HOST_BUS) -> list[can.Message]:
        """Return the frames that wait for a bus, in order."""
        result = []
        while self._library.gc_host_transmit(self._at, bus, self._frame):
            data = bytes(self._frame.data[: self._frame.length])
            result.append(can.Message(arbitration_id=self._frame.id, is_extended_id=False, data=data))
        return result

    def bus_off(self, bus: int, off: bool) -> None:
        """Let a bus be off, or on again."""
        self._library.gc_host_bus_off(self._at, bus, off)

    def loop(self) -> LoopResult:
        """Return the last results of the loop on the board, of a board that has one."""
        result = RawResult()
        self._library.gc_host_loop_read(self._at, ctypes.addressof(result))
        return LoopResult.of(result)

    @property
    def duty(self) -> float:
        """Duty of the heater in effect, 0 to 1."""
        return 1e-4 * self._library.gc_host_duty(self._at)

    @property
    def faults(self) -> int:
        """Bits of the present faults."""
        return self._library.gc_host_faults(self._at)
