"""Model of a bxCAN controller [RM0090, section 32.9]: frames go into FIFO 0 without limit, and mailboxes are free at once."""

import struct
from collections import deque
from typing import NamedTuple

MCR, MSR, TSR, RF0R, ESR, BTR = 0x00, 0x04, 0x08, 0x0C, 0x18, 0x1C
_TX, _RX, _BOX = 0x180, 0x1B0, 0x10
_INRQ, _EMPTY, _TXRQ, _BOFF, _RELEASE = 1, 7 << 26, 1, 1 << 2, 1 << 5


class WireFrame(NamedTuple):
    """A frame as the registers have it: identifier register, length, eight bytes."""

    identifier: int
    length: int
    data: bytes


class CanController:
    """State of one controller. Attributes: received (frames in FIFO 0), sent (frames that have left), off (bus-off)."""

    def __init__(self) -> None:
        self.received: deque[WireFrame] = deque()
        self.sent: list[WireFrame] = []
        self.off = False
        self._registers: dict[int, int] = {MCR: 2}

    def read(self, offset: int) -> int:
        """Return a register."""
        if offset == MSR:
            return self._registers.get(MCR, 0) & _INRQ
        if offset == TSR:
            return 0 if self.off else _EMPTY
        if offset == RF0R:
            return min(3, len(self.received))
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
            self.sent.append(WireFrame(value & ~_TXRQ, length & 15, struct.pack("<2I", low, high)))

    @property
    def bit_rate(self) -> float:
        """Bits a second that the firmware has set, at 42 MHz."""
        timing = self._registers.get(BTR, 0)
        quanta = 3 + (timing >> 16 & 15) + (timing >> 20 & 7)
        return 42e6 / ((timing & 0x3FF) + 1) / quanta
