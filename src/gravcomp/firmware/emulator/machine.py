"""The processor and the peripherals around it: memory, registers by address, interrupts as calls of their handlers.

Interrupts come while the image waits for them, or where main's loop enters the function `preempted_in`; a handler runs to its
end. That is what the image's priorities give it, except for the interrupt of reception, which shares with the others nothing but
rings with one writer and one reader. While a sector of the flash is erased no interrupt comes: the image masks them, and the
processor could not read their code. What has happened meanwhile comes after that.
"""

import struct
from collections.abc import Callable
from typing import Any

from gravcomp.firmware.emulator.can_controller import CanController, WireFrame
from gravcomp.firmware.emulator.core import CCM, RAM, RETURN, Core
from gravcomp.firmware.emulator.flash_memory import MODELS, MODELS_END, FlashMemory, SupplyLost
from gravcomp.firmware.emulator.imu_device import ImuDevice
from gravcomp.firmware.image import BOOT_START, CODE_START, Image

PARAMETERS, FLASH_END = 0x08008000, 0x08100000
STACK_SIZE = 0x2000
WATCHDOG = 40_000
"""us that the watchdog waits."""

RESET_FLAGS = {"power": 1 << 27 | 1 << 25, "supply": 1 << 25, "watchdog": 1 << 29, "software": 1 << 28, "pin": 1 << 26}
"""RCC_CSR after a reset by cause."""

_PAINT = 0xA5
_START_PATIENCE = 30_000_000  # us
_WFI = b"\x30\xbf"
_PERIPHERALS, _SYSTEM, _UNIQUE = 0x40000000, 0xE000E000, 0x1FFF7000
_TIM2, _TIM10, _IWDG, _CAN1, _CAN2, _PWR, _SPI1, _EXTI = 0x0000, 0x14400, 0x3000, 0x6400, 0x6800, 0x7000, 0x13000, 0x13C00
_EDGE = 1 << 5
_GPIOA, _GPIOB, _RCC, _FLASH = 0x20000, 0x20400, 0x23800, 0x23C00
_SELECTS = {_GPIOA: (4, "acc"), _GPIOB: (0, "gyro")}


class ProcessorFault(RuntimeError):
    """The image has done what the processor does not do: it hangs, or reads where nothing is."""


class Machine(Core):
    """The chip with an image.

    Attributes: now (us), cans, imu, flash, supply_low, main_stands (main's loop does not run), preempted_in (name of a function
    in which main's loop is left until the next tick has interrupted it; empty: none), preemptions (number of these), duty,
    busy_duty (largest duty while the flash was erased), resets (their causes), dead (nothing runs).
    """

    def __init__(self, image: Image, unique_id: tuple[int, int, int] = (1, 2, 3)):
        """Raises SetupError without the emulator."""
        super().__init__(image)
        self._error = self._unicorn.UcError
        uc = self._uc
        self.flash = FlashMemory(self._erase_model)
        self._unsettled: tuple[int, int, int] | None = None  # address, size and what was there, of a write to the models
        uc.mem_map(BOOT_START, PARAMETERS - BOOT_START)
        uc.mmio_map(PARAMETERS, CODE_START - PARAMETERS, self._read_parameters, None, self._write_parameters, None)
        uc.mem_map(CODE_START, FLASH_END - CODE_START)
        uc.mem_map(_UNIQUE, 0x1000)
        uc.mem_write(_UNIQUE + 0xA10, struct.pack("<3I", *unique_id))
        uc.mmio_map(_PERIPHERALS, 0x28000, self._read, None, self._write, None)
        uc.mmio_map(_SYSTEM, 0x1000, self._read_system, None, self._write_system, None)
        if "gc_standalone_step" in self.symbols:
            uc.hook_add(self._unicorn.UC_HOOK_MEM_WRITE, self._write_model, None, MODELS, MODELS_END - 1)
        self.load(image.boot, image.code)
        main = self.symbols["main"] & ~1
        self._wait = main + bytes(uc.mem_read(main, 4096)).index(_WFI)
        uc.ctl_exits_enabled(True)
        self._exits = [self._wait, RETURN, self.symbols["gc_stuck"] & ~1]
        uc.ctl_set_exits(self._exits)
        self.preempted_in, self.preemptions = "", 0
        self._left = 0  # address at which main's loop was left, 0: it waits
        self.resets: list[str] = []
        self.supply_low = False
        self.main_stands = False
        self.cans = (CanController(), CanController())
        self.imu = ImuDevice()
        self.dead = True
        self._busy_until = 0  # us; until then the flash is erased, and no interrupt comes
        self._edge_waits = False
        self.reset("power")

    def load(self, boot: bytes, code: bytes) -> None:
        """Write both parts of an image into the flash; the models are erased."""
        self._uc.mem_write(BOOT_START, boot)
        self._uc.mem_write(CODE_START, b"\xff" * (FLASH_END - CODE_START))
        self._uc.mem_write(CODE_START, code)
        self._uc.ctl_remove_cache(BOOT_START, PARAMETERS)
        self._uc.ctl_remove_cache(CODE_START, FLASH_END)

    def load_model(self, blob: bytes) -> None:
        """Write a model into the first place for models; the other one is erased."""
        self._uc.mem_write(MODELS, blob.ljust(MODELS_END - MODELS, b"\xff"))

    def reset(self, cause: str) -> None:
        """Start the image as after a reset, and run it until it waits. `dead` where it does not come so far."""
        self.now = 0
        self.duty = self.busy_duty = 0
        self._fed = 0
        self._registers: dict[int, int] = {_RCC + 0x74: RESET_FLAGS[cause]}
        self._spi = 0xFF
        self._restart = False
        self.flash.reset()
        for can in self.cans:
            can.clear()
        self.resets.append(cause)
        self._busy_until, self._edge_waits = 0, False
        self._unsettled = None
        self._left = 0
        self._uc.mem_write(CCM, bytes([_PAINT]) * STACK_SIZE)
        stack, start = struct.unpack("<2I", self.read(BOOT_START, 8))
        self._uc.reg_write(self._arm.UC_ARM_REG_SP, stack)
        self.dead = False
        try:
            self.dead = not self._run(start, self._wait, _START_PATIENCE)
        except ProcessorFault:  # the processor would go to gc_stuck, or be reset by the watchdog for ever
            self.dead = True

    def tick(self, now: int) -> None:
        """Let the time be `now` (us) and run the interrupt of the tick, then main's loop once; the watchdog may reset."""
        if self.dead or self.is_busy(now):
            return
        self.now = now & 0xFFFFFFFF
        if self._busy_until:
            self._catch_up()
        self.interrupt("gc_on_tick")
        self._flush()
        self._run_main()
        if self._restart:
            self.reset("software")
        elif (self.now - self._fed) & 0xFFFFFFFF > WATCHDOG:
            self.reset("watchdog")

    def is_busy(self, now: int) -> bool:
        """Whether a sector of the flash is still erased at `now` (us), so that the image does nothing else."""
        return bool(self._busy_until) and (now - self._busy_until) & 0xFFFFFFFF >= 1 << 31

    def _catch_up(self) -> None:
        """Let the interrupts come that have waited for the flash."""
        self._busy_until = 0
        for can, handler in zip(self.cans, ("gc_on_host_frame", "gc_on_motor_frame")):
            can.overrun()
            if can.received:
                self.interrupt(handler)
                can.received.clear()
        if self._edge_waits:
            self._edge_waits = False
            self.data_ready(self.now)

    def data_ready(self, time: int) -> None:
        """Let the gyroscope's data-ready edge come at `time` (us)."""
        if self.dead or not self.imu.set_up or self.imu.silent:
            return
        if self._busy_until:
            self._edge_waits = True
            return
        self._registers[_EXTI + 0x14] = _EDGE
        tick, self.now = self.now, time & 0xFFFFFFFF
        self.interrupt("gc_on_edge")
        self.now = tick
        self.interrupt("gc_on_data_ready")
        self._flush()
        self._run_main()

    def receive(self, bus: int, frames: list[WireFrame]) -> None:
        """Let frames come on a bus."""
        if self.dead or not frames:
            return
        self.cans[bus].arrive(frames)
        if self._busy_until or not self.cans[bus].received:
            return
        self.interrupt("gc_on_host_frame" if bus == 0 else "gc_on_motor_frame")
        self.cans[bus].received.clear()

    def interrupt(self, handler: str) -> None:
        """Run the handler of an interrupt; what it may change of main's registers is kept."""
        kept = self._uc.context_save()
        self._uc.reg_write(self._arm.UC_ARM_REG_LR, RETURN | 1)
        self._run(self.symbols[handler] | 1, RETURN)
        if not self.dead:
            self._uc.context_restore(kept)

    def call(self, name: str, *arguments: int) -> int:
        """Call a function of the image and return its result."""
        kept = self._uc.context_save()
        self._run(self._enter(name, arguments), RETURN)
        result = self._uc.reg_read(self._arm.UC_ARM_REG_R0)
        self._uc.context_restore(kept)
        return result

    @property
    def stack_used(self) -> int:
        """Bytes of the stack that were used since the reset, without the frames of interrupts."""
        stack = self.read(CCM, STACK_SIZE)
        return STACK_SIZE - next((k for k, byte in enumerate(stack) if byte != _PAINT), STACK_SIZE)

    def _flush(self) -> None:
        """Let the interrupts of the mailboxes come until no more frames leave."""
        for can, handler in zip(self.cans, ("gc_on_host_sent", "gc_on_motor_sent")):
            before = -1
            while len(can.sent) != before and not self.dead and not can.off:
                before = len(can.sent)
                self.interrupt(handler)

    def _run_main(self) -> None:
        """Run main's loop until it waits, or until it enters `preempted_in`, from where the next call continues."""
        if self.dead or self.main_stands:
            return
        start, stop = self._left or self._wait + 2, 0
        if self.preempted_in and not self._left:
            stop = self.symbols[self.preempted_in] & ~1
            self._exit_at([*self._exits, stop])
        waits = self._run(start, self._wait)
        self._left = 0
        if stop:
            self._exit_at(self._exits)
            if not waits and not self.dead and self._uc.reg_read(self._arm.UC_ARM_REG_PC) & ~1 == stop:
                self._left = stop
                self.preemptions += 1

    def _exit_at(self, addresses: list[int]) -> None:
        """End a run at these addresses: the emulator looks at them when it translates code."""
        self._uc.ctl_set_exits(addresses)
        self._uc.ctl_flush_tb()

    def _run(self, start: int, end: int, patience: int = 0) -> bool:
        """Run from an address until the image waits, returns or gives up; return whether that is `end`.

        patience: us of the host's time after which it counts as hanging; 0: without end. Raises ProcessorFault.
        """
        self._lost = False
        self._failure: Exception | None = None
        try:
            self._uc.emu_start(start | 1, 0, timeout=patience)
            self._guarded(self._settle)
        except self._error as error:
            at = self._uc.reg_read(self._arm.UC_ARM_REG_PC)
            raise ProcessorFault(f"at 0x{at:08X}: {error}") from error
        if self._failure is not None:
            raise self._failure
        if self._lost:
            self.dead = True
            return False
        return self._uc.reg_read(self._arm.UC_ARM_REG_PC) & ~1 == end

    def _guarded(self, action: Callable[..., Any], *arguments: int) -> Any:
        """Call a model from the emulator, which cannot pass exceptions on."""
        try:
            return action(*arguments)
        except SupplyLost:
            self._lost = True
            self._uc.emu_stop()
        except Exception as error:
            self._failure = error
            self._uc.emu_stop()
        return 0

    def _read_parameters(self, uc: Any, offset: int, size: int, _: Any) -> int:
        return int.from_bytes(self.flash.data[offset : offset + size], "little")

    def _write_parameters(self, uc: Any, offset: int, size: int, value: int, _: Any) -> None:
        self._guarded(self.flash.write, offset, size, value)

    def _erase_model(self, address: int, size: int) -> None:
        self._uc.mem_write(address, b"\xff" * size)

    def _write_model(self, uc: Any, _: int, address: int, size: int, value: int, __: Any) -> None:
        """Take note of a write to the models: the emulator makes it, and `_settle` what the flash makes of it."""
        self._guarded(self._settle)
        self._unsettled = (address, size, int.from_bytes(uc.mem_read(address, size), "little"))

    def _settle(self) -> None:
        """Let the last place of the models that was written have what the flash has there then. Raises SupplyLost."""
        if self._unsettled is None:
            return
        (address, size, before), self._unsettled = self._unsettled, None
        value = int.from_bytes(self._uc.mem_read(address, size), "little")
        self._uc.mem_write(address, before.to_bytes(size, "little"))
        self._uc.mem_write(address, self.flash.written(before, value).to_bytes(size, "little"))

    def _read_system(self, uc: Any, offset: int, size: int, _: Any) -> int:
        return 0

    def _write_system(self, uc: Any, offset: int, size: int, value: int, _: Any) -> None:
        if offset == 0xD0C and value == 0x05FA0004:
            self._restart = True

    def _read(self, uc: Any, offset: int, size: int, _: Any) -> int:
        return self._guarded(self._register, offset) & 0xFFFFFFFF

    def _write(self, uc: Any, offset: int, size: int, value: int, _: Any) -> None:
        self._guarded(self._set_register, offset, value)

    def _register(self, offset: int) -> int:
        if offset == _TIM2 + 0x24:
            return self.now
        for start, can in ((_CAN1, self.cans[0]), (_CAN2, self.cans[1])):
            if start <= offset < start + 0x400:
                return can.read(offset - start)
        if offset == _SPI1 + 0x08:
            return 1
        if offset == _SPI1 + 0x0C:
            return self._spi
        if offset == _PWR + 0x04:
            return 4 if self.supply_low else 0
        if _FLASH < offset < _FLASH + 0x20:
            self._settle()
            self._wait_for_flash()
            return self.flash.read_register(offset - _FLASH)
        value = self._registers.get(offset, 0)
        if offset == _RCC:
            return value | (value & 1 << 16) << 1 | (value & 1 << 24) << 1  # what is switched on is ready
        if offset == _RCC + 0x08:
            return value | (value & 3) << 2
        return value

    def _wait_for_flash(self) -> None:
        """Let time pass while the flash is erased. Raises ProcessorFault where the image would read the flash meanwhile."""
        passed = self.flash.elapse()
        if not passed:
            return
        if (self.now - self._fed) & 0xFFFFFFFF > WATCHDOG:
            raise ProcessorFault("the watchdog is not fed while the flash is erased")
        at = self._uc.reg_read(self._arm.UC_ARM_REG_PC)
        if at < RAM or not self._uc.reg_read(self._arm.UC_ARM_REG_PRIMASK) & 1:
            raise ProcessorFault(f"at 0x{at:08X}: code of the flash runs, or an interrupt may come, while the flash is erased")
        self.busy_duty = max(self.busy_duty, self.duty)
        self.now = (self.now + passed) & 0xFFFFFFFF
        self._busy_until = self.now or 1

    def _set_register(self, offset: int, value: int) -> None:
        for start, can in ((_CAN1, self.cans[0]), (_CAN2, self.cans[1])):
            if start <= offset < start + 0x400:
                can.write(offset - start, value)
                return
        if offset == _IWDG and value == 0xAAAA:
            self._fed = self.now
        elif offset == _SPI1 + 0x0C:
            self._spi = self.imu.exchange(value & 0xFF)
        elif offset == _TIM10 + 0x34:
            self.duty = value
        elif offset == _EXTI + 0x14:
            self._registers[offset] = self._registers.get(offset, 0) & ~value
        elif _FLASH < offset < _FLASH + 0x20:
            self._settle()
            self.flash.write_register(offset - _FLASH, value)
        elif offset in (_GPIOA + 0x18, _GPIOB + 0x18):
            pin, device = _SELECTS[offset - 0x18]
            if value & (1 << pin | 1 << pin + 16):
                self.imu.select(device, bool(value & 1 << pin + 16))
        else:
            self._registers[offset] = value
