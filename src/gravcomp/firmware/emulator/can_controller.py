"""Model of a bxCAN controller [RM0090, section 32.9]: FIFO 0, mailboxes that are free at once, and a bus of another rate.

On a bus of another rate no frame is received or acknowledged. The first frame that is sent brings the controller into bus-off,
from where it recovers only to fail again; here it stays there until the rates agree.
"""

import struct
from collections import deque
from typing import NamedTuple

MCR, MSR, TSR, RF0R, ESR, BTR = 0x00, 0x04, 0x08, 0x0C, 0x18, 0x1C
_TX, _RX, _BOX = 0x180, 0x1B0, 0x10
_FIFO = 3  # frames
_INRQ, _EMPTY, _TXRQ, _BOFF, _RELEASE = 1, 7 << 26, 1, 1 << 2, 1 << 5


class WireFrame(NamedTuple):
    """A frame as the registers have it: identifier register, length, eight bytes."""

    identifier: int
    length: int
    data: bytes


class CanController:
    """State of one controller.

    Attributes: received (frames in FIFO 0), sent (frames that have left), short (bus-off by its wires), bus_rate (bits a second
    of the others on the bus).
    """

    def __init__(self) -> None:
        self.received: deque[WireFrame] = deque()
        self.sent: list[WireFrame] = []
        self.short = False
        self.bus_rate = 1e6
        self._waiting: list[WireFrame] = []
        self._registers: dict[int, int] = {MCR: 2}

    def clear(self) -> None:
        """Forget all frames, as at a reset."""
        self.received.clear()
        self.sent.clear()
        self._waiting.clear()

    @property
    def off(self) -> bool:
        """Whether the controller is in bus-off."""
        return self.short or (bool(self._waiting) and not self.fits_bus)

    @property
    def fits_bus(self) -> bool:
        """Whether the rate that the firmware has set is that of the bus."""
        return abs(self.bit_rate / self.bus_rate - 1.0) < 0.01

    def arrive(self, frames: list[WireFrame]) -> None:
        """Let frames come on the bus. Where nobody reads FIFO 0, the newest one takes the last place."""
        if self.fits_bus:
            self.received.extend(frames)

    def overrun(self) -> None:
        """Leave in FIFO 0 what is there when nobody has read it."""
        while len(self.received) > _FIFO:
            del self.received[_FIFO - 1]

    def read(self, offset: int) -> int:
        """Return a register."""
        if self._waiting and self.fits_bus:  # it has recovered, and the mailboxes are sent
            self.sent += self._waiting
            self._waiting.clear()
        if offset == MSR:
            return self._registers.get(MCR, 0) & _INRQ
        if offset == TSR:
            return 0 if self.off else _EMPTY
        if offset == RF0R:
            return min(_FIFO, len(self.received))
        if offset == ESR:
            return _BOFF if self.off else 0
        if _RX <= offset < _RX + _BOX and self.received:
            frame = self.received[0]
            return (frame.identifier, frame.length, *struct.unpack("<2I", frame.data))[(offset - _RX) // 4]
        return self._registers.get(offset, 0)

    def write(self, offset: int, value: int) -> None:
        """Write a register."""
        if offset == RF0R:
            if value & _RELEASE and self.received:
                self.received.popleft()
            return
        self._registers[offset] = value
        if _TX <= offset < _RX and (offset - _TX) % _BOX == 0 and value & _TXRQ:
            length, low, high = (self._registers.get(offset + 4 * k, 0) for k in (1, 2, 3))
            (self.sent if self.fits_bus else self._waiting).append(
                WireFrame(value & ~_TXRQ, length & 15, struct.pack("<2I", low, high))
            )

    @property
    def bit_rate(self) -> float:
        """Bits a second that the firmware has set, at 42 MHz."""
        timing = self._registers.get(BTR, 0)
        quanta = 3 + (timing >> 16 & 15) + (timing >> 20 & 7)
        return 42e6 / ((timing & 0x3FF) + 1) / quanta
