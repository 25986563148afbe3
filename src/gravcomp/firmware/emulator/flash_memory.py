"""Model of the flash's controller and of the two sectors of the parameters [RM0090, section 3.9].

Writing can only clear bits, needs the bit PG, and is refused while the controller is locked. The supply can fail at any word.
"""

SECTOR = 0x4000
_KEYS = (0x45670123, 0xCDEF89AB)
_KEYR, _SR, _CR = 0x04, 0x0C, 0x10
_PG, _SER, _STRT, _LOCK, _ERROR = 1, 2, 1 << 16, 1 << 31, 1 << 7
_FIRST_SECTOR = 2


class SupplyLost(Exception):
    """The supply has failed while the flash was written."""


class FlashMemory:
    """State of controller and sectors. Attributes: data (both sectors), words_left (until the supply fails; None: never)."""

    def __init__(self) -> None:
        self.data = bytearray(b"\xff" * 2 * SECTOR)
        self.words_left: int | None = None
        self.reset()

    def reset(self) -> None:
        """Reset the controller; what is stored stays."""
        self._control, self._status, self._keys = _LOCK, 0, 0

    def read_register(self, offset: int) -> int:
        """Return a register of the controller."""
        return {_SR: self._status, _CR: self._control}.get(offset, 0)

    def write_register(self, offset: int, value: int) -> None:
        """Write a register of the controller. Raises SupplyLost."""
        if offset == _KEYR:
            self._keys = self._keys + 1 if value == _KEYS[min(self._keys, 1)] else 0
            if self._keys == len(_KEYS):
                self._control, self._keys = self._control & ~_LOCK, 0
        elif offset == _SR:
            self._status &= ~value
        elif offset == _CR and not self._control & _LOCK:
            self._control = value
            if value & _STRT and value & _SER:
                self._spend()
                start = ((value >> 3 & 15) - _FIRST_SECTOR) * SECTOR
                if 0 <= start < len(self.data):
                    self.data[start : start + SECTOR] = b"\xff" * SECTOR
                self._control &= ~_STRT

    def write(self, offset: int, size: int, value: int) -> None:
        """Write to a sector as the processor does. Raises SupplyLost."""
        if not self._control & _PG or self._control & _LOCK:
            self._status |= _ERROR
            return
        self._spend()
        for k, byte in enumerate(value.to_bytes(size, "little")):
            self.data[offset + k] &= byte

    def _spend(self) -> None:
        if self.words_left is None:
            return
        if self.words_left == 0:
            raise SupplyLost
        self.words_left -= 1
