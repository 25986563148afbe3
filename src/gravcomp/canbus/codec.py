"""Encoding and decoding of the frames in gravcomp.dbc.

The DBC file is the only description of the frames. cantools reads it once, and each frame is compiled into a `struct` layout:
cantools' own bit-wise decoding (20 to 50 us per frame) would cost more than the rest of the bridge.

    physical value = raw value x scale + offset

Frames whose last signal is `check` carry CRC-8/SAE-J1850 over (low byte of the id, all bytes before the check).
"""

import collections
import functools
import math
import struct
from collections.abc import Callable, Iterable
from importlib import resources
from typing import Any, NamedTuple

import can

PROTOCOL = 1
"""Version of the board's frames; BoardStatus.protocol must be equal."""

_STRUCT_CODES = {(8, False): "B", (8, True): "b", (16, False): "H", (16, True): "h", (32, False): "I", (32, True): "i"}


class FrameError(ValueError):
    """A frame does not fit its id, or a value does not fit its signal."""


class Decoded(NamedTuple):
    """A decoded frame: its name in the DBC, and a named tuple of its signals in physical units."""

    name: str
    values: Any


class Layout:
    """Layout of one frame of the DBC. Attributes: name, frame_id, length, signals, checked (whether it has a check byte)."""

    def __init__(self, message: Any):
        """Compile a cantools Message. Raises ValueError when a signal is not byte-aligned and big-endian."""
        self.name, self.frame_id, self.length = message.name, message.frame_id, message.length
        code, byte = ">", 0
        self.signals = []
        for signal in sorted(message.signals, key=lambda s: 8 * (s.start // 8) - s.start % 8):
            key = (signal.length, signal.is_signed)
            if signal.byte_order != "big_endian" or signal.start % 8 != 7 or key not in _STRUCT_CODES:
                raise ValueError(f"{message.name}.{signal.name}: only byte-aligned big-endian 8, 16 and 32 bits are supported")
            code += "x" * (signal.start // 8 - byte) + _STRUCT_CODES[key]
            byte = signal.start // 8 + signal.length // 8
            self.signals.append(signal)
        self._struct = struct.Struct(code + "x" * (self.length - byte))
        self._make: Callable[[Iterable], Any] = _tuple_class(self.name, [s.name for s in self.signals])._make
        self._scaling = [(float(s.scale), float(s.offset), s.scale == 1 and s.offset == 0) for s in self.signals]
        self._plain = all(plain for _, _, plain in self._scaling)
        self.checked = self.signals[-1].name == "check"
        self._given = []  # of each signal except the check: name, scale, offset, smallest and largest count
        for signal, (scale, offset, _) in zip(self.signals, self._scaling):
            low = -(1 << signal.length - 1) if signal.is_signed else 0
            if signal.name != "check":
                self._given.append((signal.name, scale, offset, low, low + (1 << signal.length) - 1))
        self._names = {name for name, *_ in self._given}

    def decode(self, data: bytes) -> Any:
        """Return the named tuple of physical values. Raises FrameError for a wrong length or check byte."""
        if len(data) != self.length:
            raise FrameError(f"{self.name} has {len(data)} bytes; {self.length} are needed")
        if self.checked and data[-1] != check_byte(self.frame_id, data[:-1]):
            raise FrameError(f"{self.name}: wrong check byte")
        raw = self._struct.unpack(data)
        if self._plain:
            return self._make(raw)
        return self._make([r if plain else r * scale + offset for r, (scale, offset, plain) in zip(raw, self._scaling)])

    def encode(self, values: dict[str, float]) -> bytes:
        """Return the bytes for physical values by signal name, rounded to the nearest count; `check` is filled in.

        Raises FrameError for a missing or unknown signal, a value that is not finite, or one out of range.
        """
        try:
            # As many values as signals, each found by its name: those are all.
            raw = [round((values[name] - offset) / scale) for name, scale, offset, _, _ in self._given]
            data = self._struct.pack(*raw, 0) if self.checked else self._struct.pack(*raw)
            if len(raw) != len(values):
                raise KeyError
        except (KeyError, ValueError, OverflowError, struct.error):
            raise FrameError(self._refusal(values)) from None
        return data[:-1] + bytes([check_byte(self.frame_id, data[:-1])]) if self.checked else data

    def _refusal(self, values: dict[str, float]) -> str:
        """Return what is wrong with values that do not fit."""
        if values.keys() != self._names:
            return f"{self.name} has the signals {', '.join(name for name, *_ in self._given)}; got {', '.join(values)}"
        for name, scale, offset, low, high in self._given:
            value = values[name]
            if not math.isfinite(value):
                return f"{self.name}.{name} is {value}; a finite number is needed"
            if not low <= round((value - offset) / scale) <= high:
                return f"{self.name}.{name} is {value:g}; allowed: {low * scale + offset:g} to {high * scale + offset:g}"
        raise AssertionError(f"{self.name}: {values} fit")


@functools.cache
def layouts() -> dict[int, Layout]:
    """Return the layouts of all frames in the DBC by frame id."""
    import cantools.database

    text = resources.files(__package__).joinpath("gravcomp.dbc").read_text(encoding="ascii")
    database: Any = cantools.database.load_string(text, database_format="dbc")
    return {message.frame_id: Layout(message) for message in database.messages}


@functools.cache
def layout(name: str) -> Layout:
    """Return the layout of a frame by its name in the DBC."""
    return next(entry for entry in layouts().values() if entry.name == name)


def decode(message: can.Message) -> Decoded:
    """Return the frame's name and values.

    Raises FrameError for an unknown id, an error, remote or extended frame, and a wrong length or check byte.
    """
    if message.is_error_frame or message.is_remote_frame or message.is_extended_id or message.is_fd:
        raise FrameError(f"id 0x{message.arbitration_id:X} is not a standard data frame")
    entry = layouts().get(message.arbitration_id)
    if entry is None:
        raise FrameError(f"id 0x{message.arbitration_id:X} is not in gravcomp.dbc")
    return Decoded(entry.name, entry.decode(bytes(message.data)))


def encode(name: str, /, **values: float) -> can.Message:
    """Return the frame `name` with these signals in physical units. Raises FrameError for a value that does not fit."""
    entry = layout(name)
    return can.Message(arbitration_id=entry.frame_id, is_extended_id=False, data=entry.encode(values))


def check_byte(frame_id: int, data: bytes) -> int:
    """Return the CRC-8/SAE-J1850 (polynomial 0x1D, start and final 0xFF) of the id's low byte and the data."""
    crc = _CRC_TABLE[0xFF ^ (frame_id & 0xFF)]
    for byte in data:
        crc = _CRC_TABLE[crc ^ byte]
    return crc ^ 0xFF


def _tuple_class(name: str, fields: list[str]) -> Any:
    return collections.namedtuple(name, fields)


def _crc_table() -> bytes:
    table = bytearray(256)
    for index in range(256):
        crc = index
        for _ in range(8):
            crc = (crc << 1 ^ 0x1D) & 0xFF if crc & 0x80 else crc << 1
        table[index] = crc
    return bytes(table)


_CRC_TABLE = _crc_table()
