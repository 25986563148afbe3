"""Model of the BMI088 on its SPI bus [BMI088 data sheet]: two devices with a select each."""

import struct

_ACC_ID, _ACC_X, _ACC_TEMPERATURE, _ACC_POWER, _ACC_RESET = 0x00, 0x12, 0x22, 0x7D, 0x7E
_GYRO_ID, _GYRO_X, _GYRO_RESET, _GYRO_INTERRUPT = 0x00, 0x02, 0x14, 0x15
_RESET, _READ = 0xB6, 0x80


class ImuDevice:
    """State of the chip. Attributes: selected ('acc', 'gyro' or None), silent (it does not answer)."""

    def __init__(self) -> None:
        self.selected: str | None = None
        self.silent = False
        self._registers = {"acc": bytearray(128), "gyro": bytearray(128)}
        self._registers["acc"][_ACC_ID], self._registers["gyro"][_GYRO_ID] = 0x1E, 0x0F
        self._exchanged: list[int] = []

    @property
    def set_up(self) -> bool:
        """Whether the firmware has switched the accelerometer on and the data-ready edge."""
        return self._registers["acc"][_ACC_POWER] == 4 and self._registers["gyro"][_GYRO_INTERRUPT] == 0x80

    def measure(self, counts: tuple[int, ...], temperature: int) -> None:
        """Set six counts and the temperature (0.125 degC from 23 degC) in the registers."""
        self._registers["acc"][_ACC_X : _ACC_X + 6] = struct.pack("<3h", *counts[:3])
        self._registers["gyro"][_GYRO_X : _GYRO_X + 6] = struct.pack("<3h", *counts[3:])
        raw = temperature & 0x7FF
        self._registers["acc"][_ACC_TEMPERATURE : _ACC_TEMPERATURE + 2] = bytes([raw >> 3, (raw & 7) << 5])

    def select(self, device: str, selected: bool) -> None:
        """Take the level of a select pin; a new select begins a new transfer."""
        if selected:
            self.selected, self._exchanged = device, []
        elif self.selected == device:
            self.selected = None

    def exchange(self, byte: int) -> int:
        """Take a byte of the master and return the byte that comes back meanwhile."""
        if self.selected is None or self.silent:
            return 0xFF
        self._exchanged.append(byte)
        registers, position = self._registers[self.selected], len(self._exchanged) - 1
        address = self._exchanged[0] & 0x7F
        if position == 0:
            return 0xFF
        if self._exchanged[0] & _READ:
            place = address + position - (2 if self.selected == "acc" else 1)
            return registers[place % 128] if place >= address else 0xFF
        if byte == _RESET and address == (_ACC_RESET if self.selected == "acc" else _GYRO_RESET):
            self._reset(self.selected)
        else:
            registers[address] = byte
        return 0xFF

    def _reset(self, device: str) -> None:
        if device == "acc":
            self._registers[device][_ACC_POWER] = 0
        else:
            self._registers[device][_GYRO_INTERRUPT] = 0
