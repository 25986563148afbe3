"""The emulator's Cortex-M4 with an image: memory, symbols, and how a function is called [AAPCS32, section 6.4]."""

import struct
from typing import Any

from gravcomp.firmware.elf import Elf, read_elf
from gravcomp.firmware.image import Image
from gravcomp.firmware.toolchain import provide

FLASH, FLASH_SIZE, RAM, RAM_SIZE, CCM, CCM_SIZE = 0x08000000, 0x100000, 0x20000000, 0x20000, 0x10000000, 0x10000
"""Memory of the STM32F407xG (boards/stm32f407/image.ld)."""

RETURN = 0x08007FF0
"""Nothing is there; a function that returns comes to it."""


class Core:
    """The processor without its peripherals and its flash. Attribute: symbols (of the image)."""

    def __init__(self, image: Image):
        """Raises SetupError without the emulator."""
        provide()
        import unicorn
        from unicorn import arm_const

        self._arm, self._unicorn = arm_const, unicorn
        self._elf: Elf = read_elf(image.path.read_bytes())
        self.symbols = self._elf.symbols
        self._uc: Any = unicorn.Uc(unicorn.UC_ARCH_ARM, unicorn.UC_MODE_THUMB | unicorn.UC_MODE_MCLASS)
        self._uc.ctl_set_cpu_model(arm_const.UC_CPU_ARM_CORTEX_M4)
        self._uc.mem_map(RAM, RAM_SIZE)
        self._uc.mem_map(CCM, CCM_SIZE)

    def read(self, address: int, count: int) -> bytes:
        """Return bytes of the memory."""
        return bytes(self._uc.mem_read(address, count))

    def write(self, address: int, data: bytes) -> None:
        """Write bytes into the memory, whatever it is."""
        self._uc.mem_write(address, data)

    def _enter(self, name: str, arguments: tuple[int, ...]) -> int:
        """Prepare the call of a function with these words; return where it begins. The stack pointer is set already."""
        uc, arm = self._uc, self._arm
        registers = (arm.UC_ARM_REG_R0, arm.UC_ARM_REG_R1, arm.UC_ARM_REG_R2, arm.UC_ARM_REG_R3)
        for register, value in zip(registers, arguments):
            uc.reg_write(register, value)
        behind = arguments[len(registers) :]
        stack = uc.reg_read(arm.UC_ARM_REG_SP) - 8 * (-(-len(behind) // 2))
        uc.reg_write(arm.UC_ARM_REG_SP, stack)
        self.write(stack, struct.pack(f"<{len(behind)}I", *behind))
        uc.reg_write(arm.UC_ARM_REG_LR, RETURN | 1)
        return self.symbols[name] | 1
