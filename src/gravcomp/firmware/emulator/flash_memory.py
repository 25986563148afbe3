"""Model of the flash's controller and of the sectors that the firmware writes [RM0090, section 3.9].

Writing can only clear bits, needs the bit PG, and is refused while the controller is locked. The supply can fail at any word.
The two sectors of the parameters are here; those of the models are in the emulator's memory, because the image reads them all
the time.
"""

from collections.abc import Callable

SECTOR = 0x4000
MODELS, MODEL_SECTOR, MODELS_END = 0x08040000, 0x20000, 0x08100000
"""Sectors 6 to 11."""

LONGEST_ERASURE = (500_000, 2_000_000)
"""us that a sector of 16 KB and one of 128 KB may take to be erased [STM32F407 datasheet, DS8626 table 40]."""

POLL = 250
"""us that pass between two looks of the image at a busy flash."""

_KEYS = (0x45670123, 0xCDEF89AB)
_OPTION_KEYS = (0x08192A3B, 0x4C5D6E7F)
_KEYR, _OPTKEYR, _SR, _CR, _OPTCR = 0x04, 0x08, 0x0C, 0x10, 0x14
_OPTION_LOCK, _OPTION_START, _SHIPPED = 1, 2, 0x0FFFAAEC
_PG, _SER, _STRT, _LOCK, _ERROR, _BUSY = 1, 2, 1 << 16, 1 << 31, 1 << 7, 1 << 16
_FIRST_SECTOR, _FIRST_MODEL_SECTOR = 2, 6


class SupplyLost(Exception):
    """The supply has failed while the flash was written."""


class FlashMemory:
    """State of controller and sectors.

    Attributes: data (both sectors), words_left (until the supply fails; None: never), erasure (us that a sector of the parameters
    and one of the models take; default: none), busy (us that are left of an erasure),
    options (those of the chip, without the bits of their register), options_written (times).
    """

    def __init__(self, erase_model: Callable[[int, int], None] | None = None) -> None:
        """erase_model: takes address and size of a sector of the models that is erased."""
        self._erase_model = erase_model
        self.data = bytearray(b"\xff" * 2 * SECTOR)
        self.words_left: int | None = None
        self.options, self.options_written = _SHIPPED, 0
        self.erasure = (0, 0)
        self.reset()

    def reset(self) -> None:
        """Reset the controller; what is stored stays."""
        self._control, self._status, self._keys = _LOCK, 0, 0
        self._option_keys, self._option_register = 0, self.options | _OPTION_LOCK
        self.busy = 0

    def read_register(self, offset: int) -> int:
        """Return a register of the controller."""
        status = self._status | (_BUSY if self.busy else 0)
        return {_SR: status, _CR: self._control, _OPTCR: self._option_register}.get(offset, 0)

    def elapse(self) -> int:
        """Let the time between two looks at a busy flash pass; return it in us, 0 where it is not busy."""
        passed = min(POLL, self.busy)
        self.busy -= passed
        return passed

    def write_register(self, offset: int, value: int) -> None:
        """Write a register of the controller. Raises SupplyLost."""
        if offset == _KEYR:
            self._keys = self._keys + 1 if value == _KEYS[min(self._keys, 1)] else 0
            if self._keys == len(_KEYS):
                self._control, self._keys = self._control & ~_LOCK, 0
        elif offset == _OPTKEYR:
            self._option_keys = self._option_keys + 1 if value == _OPTION_KEYS[min(self._option_keys, 1)] else 0
            if self._option_keys == len(_OPTION_KEYS):
                self._option_register, self._option_keys = self._option_register & ~_OPTION_LOCK, 0
        elif offset == _OPTCR and not self._option_register & _OPTION_LOCK:
            self._option_register = value & ~_OPTION_START
            if value & _OPTION_START:
                self._spend()
                self.options, self.busy = value & ~(_OPTION_LOCK | _OPTION_START), self.erasure[0]
                self.options_written += 1
        elif offset == _SR:
            self._status &= ~value
        elif offset == _CR and not self._control & _LOCK:
            self._control = value
            if value & _STRT and value & _SER:
                self._spend()
                self._erase(value >> 3 & 15)
                self._control &= ~_STRT

    def write(self, offset: int, size: int, value: int) -> None:
        """Write to a sector of the parameters as the processor does. Raises SupplyLost."""
        before = int.from_bytes(self.data[offset : offset + size], "little")
        self.data[offset : offset + size] = self.written(before, value).to_bytes(size, "little")

    def written(self, before: int, value: int) -> int:
        """Return what a place has that had `before` and to which the processor writes `value`. Raises SupplyLost."""
        if not self._control & _PG or self._control & _LOCK:
            self._status |= _ERROR
            return before
        self._spend()
        return before & value

    def _erase(self, sector: int) -> None:
        start = (sector - _FIRST_SECTOR) * SECTOR
        self.busy = self.erasure[sector >= _FIRST_MODEL_SECTOR]
        if 0 <= start < len(self.data):
            self.data[start : start + SECTOR] = b"\xff" * SECTOR
        elif sector >= _FIRST_MODEL_SECTOR and self._erase_model is not None:
            self._erase_model(MODELS + (sector - _FIRST_MODEL_SECTOR) * MODEL_SECTOR, MODEL_SECTOR)

    def _spend(self) -> None:
        if self.words_left is None:
            return
        if self.words_left == 0:
            raise SupplyLost
        self.words_left -= 1
