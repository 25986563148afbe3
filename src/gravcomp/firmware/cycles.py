"""Processor cycles of a function of the image, estimated from the instructions that it executes in the emulator.

The costs are those of the Cortex-M4 Technical Reference Manual (r0p1, tables 3-1 and 7-1): 1 for most instructions, 2 for a load
or store by itself (1 behind another one of the same kind), 1 + n for n registers, 14 for a division or root of floats, 3 for a
fused or chained multiply-add, 12 for a division of integers, 3 for a taken branch; one more for a float that the next instruction
of the unit uses. The flash of the STM32F407 has 5 wait states at 168 MHz (RM0090 section 3.5); of its accelerator the cache of
64 lines of instructions, 16 bytes each, and its reading ahead are modelled. The model's tables pass by the cache of data.
"""

import bisect
import collections
import dataclasses
import struct
from collections.abc import Sequence
from typing import Any

from gravcomp.firmware.emulator.core import CCM, CCM_SIZE, FLASH, FLASH_SIZE, RAM, RAM_SIZE, RETURN, Core
from gravcomp.firmware.image import Image
from gravcomp.firmware.model_settings import CABLES_MAX

CLOCK_HZ = 168e6
MODEL_AT = 0x08040000
"""Where the first model is in the flash (boards/stm32f407/image.ld)."""

MEMORY_AT = 0x20008000
"""Begin of the RAM that the image's own data leave free."""

_LINE, _WAIT, _WAIT_BEHIND, _INSTRUCTION_LINES = 4, 5, 1, 64
_TAKEN = 2
_CHAINED = ("vmla", "vmls", "vfma", "vfms", "vnmla", "vnmls", "vfnma", "vfnms")
_BRANCHES = frozenset(
    ["b", "bl", "blx", "bx", "cbz", "cbnz", "tbb", "tbh"]
    + [f"b{c}" for c in ("eq", "ne", "hs", "lo", "mi", "pl", "vs", "vc", "hi", "ls", "ge", "lt", "gt", "le")]
)


@dataclasses.dataclass(frozen=True)
class Cycles:
    """Cycles of a call: executed, waited for the flash's data and for its code; by_function: of those executed."""

    executed: int
    data_waits: int
    code_waits: int
    by_function: dict[str, int]

    @property
    def milliseconds(self) -> float:
        """Estimated time at 168 MHz in ms."""
        return 1e3 * (self.executed + self.data_waits + self.code_waits) / CLOCK_HZ


class _Lines:
    """The accelerator's cache of instructions: lines of 16 bytes, replaced when they were used longest ago.

    A line behind the last one is read ahead while that one's four instructions run, which takes four cycles at least.
    """

    def __init__(self, count: int):
        self._count, self._lines, self._last = count, collections.OrderedDict[int, None](), -1
        self.waits = 0

    def touch(self, first: int, last: int) -> None:
        for line in range(first >> _LINE, (last >> _LINE) + 1):
            if line in self._lines:
                self._lines.move_to_end(line)
            else:
                self.waits += _WAIT_BEHIND if line == self._last + 1 else _WAIT
                self._lines[line] = None
                if len(self._lines) > self._count:
                    self._lines.popitem(last=False)
            self._last = line


class Processor(Core):
    """The processor with an image and a model, without peripherals: functions are called one by one."""

    def __init__(self, image: Image, blob: bytes = b"", counts: bool = False):
        """counts: the cycles of each call are counted, which is slow. Raises SetupError without the emulator."""
        super().__init__(image)
        import capstone

        self._disassembler = capstone.Cs(capstone.CS_ARCH_ARM, capstone.CS_MODE_THUMB | capstone.CS_MODE_MCLASS)
        self._disassembler.detail = True
        uc, elf = self._uc, self._elf
        uc.mem_map(FLASH, FLASH_SIZE)
        for address, _, data in elf.segments:
            uc.mem_write(address, data)
        start, end, source = (elf.symbols[f"gc_data_{name}"] for name in ("start", "end", "source"))
        uc.mem_write(start, bytes(uc.mem_read(source, end - start)))  # as the image's start does
        uc.mem_write(MODEL_AT, blob)
        self._functions = sorted((address & ~1, name) for name, address in elf.symbols.items() if address & 1)
        self._blocks: dict[int, tuple[int, int, bool, str]] = {}
        self._counter: _Counter | None = None
        if counts:  # a hook of the emulator has to be there before it translates the code
            uc.hook_add(self._unicorn.UC_HOOK_BLOCK, lambda *values: self._counter and self._counter.block(*values))
        self._counts = counts

    def call(self, name: str, *arguments: int) -> tuple[int, Cycles | None]:
        """Call a function; return its result and, where they are counted, its cycles."""
        uc, arm = self._uc, self._arm
        uc.reg_write(arm.UC_ARM_REG_SP, CCM + CCM_SIZE)
        start = self._enter(name, arguments)
        self._counter = _Counter(self) if self._counts else None
        uc.emu_start(start, RETURN)
        return uc.reg_read(arm.UC_ARM_REG_R0), self._counter.result() if self._counter else None

    def take_model(self, blob: bytes) -> bool:
        """Let the loop at MEMORY_AT take the model; return whether it does."""
        magic = int.from_bytes(blob[:4], "little")
        return bool(self.call("gc_standalone_take", MEMORY_AT, MODEL_AT, len(blob), magic, 0)[0] & 0xFF)

    def block_at(self, address: int, size: int) -> tuple[int, int, bool, str]:
        """Return cost, end, whether it ends with a branch, and function of a block of instructions."""
        known = self._blocks.get(address)
        if known is None:
            instructions = list(self._disassembler.disasm(self.read(address, size), address))
            total, before = 0, None
            for instruction in instructions:
                total += self._cost(instruction, before)
                before = instruction
            at = bisect.bisect_right(self._functions, (address, "~")) - 1
            name = self._functions[at][1] if at >= 0 else "?"
            known = self._blocks[address] = (total, address + size, bool(before) and _is_branch(before), name)
        return known

    def _cost(self, instruction: Any, before: Any) -> int:
        """Return the cycles of an instruction behind another one, a branch not taken."""
        name = instruction.mnemonic.split(".")[0]
        registers = sum(1 for operand in instruction.operands if operand.type == 1)
        previous = "" if before is None else before.mnemonic.split(".")[0]
        if name.startswith(("vldm", "vstm", "ldm", "stm")):
            return registers  # the base register stands for the first cycle
        if name.startswith(("vpush", "vpop", "push", "pop")):
            return 1 + registers
        if name.startswith(("ldrd", "strd")):
            return 3
        for kind in ("ldr", "str"):
            if name.startswith(kind):
                return 1 if previous.startswith(kind) else 2
        if name.startswith(("vldr", "vstr")):
            return 2
        if name.startswith("v"):
            cost = 14 if name.startswith(("vdiv", "vsqrt")) else 3 if name.startswith(_CHAINED) else 1
            return cost + (previous.startswith("v") and self._uses(instruction, before))
        return 12 if name in ("sdiv", "udiv") else 1

    def _uses(self, instruction: Any, before: Any) -> bool:
        """Return whether an instruction reads a float that the one before it has computed."""
        if before.mnemonic.startswith(("vld", "vst", "vpush", "vpop")):
            return False
        shared = set(before.regs_access()[1]) & set(instruction.regs_access()[0])
        return any(self._disassembler.reg_name(register)[0] in "sd" for register in shared)


class _Counter:
    """Counts while a function runs."""

    def __init__(self, processor: Processor):
        self._processor = processor
        self._code = _Lines(_INSTRUCTION_LINES)
        self._executed: collections.Counter[str] = collections.Counter()
        self._last: tuple[int, int, bool, str] | None = None

    def result(self) -> Cycles:
        """Return what was counted."""
        return Cycles(sum(self._executed.values()), 0, self._code.waits, dict(self._executed.most_common()))

    def block(self, _: Any, address: int, size: int, __: Any) -> None:
        """Take note that a block of instructions runs."""
        block = self._processor.block_at(address, size)
        if self._last is not None and self._last[2] and self._last[1] != address:
            self._executed[self._last[3]] += _TAKEN
        self._executed[block[3]] += block[0]
        self._last = block
        if address < FLASH + FLASH_SIZE:
            self._code.touch(address, address + size - 1)


def _is_branch(instruction: Any) -> bool:
    name = instruction.mnemonic.split(".")[0]
    return name in _BRANCHES or (name.startswith("pop") and "pc" in instruction.op_str)


def loop_cycles(image: Image, blob: bytes, samples: Sequence[bytes], uncounted: int, motors: int = 0xFF) -> list[Cycles]:
    """Return the cycles of gc_standalone_step for each sample after the first `uncounted` ones.

    image: with the loop on the board; samples: gc_sample as bytes. Raises RuntimeError where the firmware refuses the blob.
    """
    plain, counting = Processor(image, blob), Processor(image, blob, counts=True)
    sample, targets = MEMORY_AT + 0x17000, MEMORY_AT + 0x17100
    if not plain.take_model(blob):
        raise RuntimeError("the image refuses the model")
    counted = []
    for number, data in enumerate(samples):
        processor = counting if number >= uncounted else plain
        if number == uncounted:
            counting.write(RAM, plain.read(RAM, RAM_SIZE))
        processor.write(sample, data)
        _, cycles = processor.call("gc_standalone_step", MEMORY_AT, sample, motors, targets, targets + 64)
        if cycles is not None:
            counted.append(dataclasses.replace(cycles, data_waits=table_waits(blob)))
    return counted


def table_waits(blob: bytes) -> int:
    """Return the cycles for which a step waits for the model's tables, read line by line of 16 bytes, with nothing in the cache.

    The step reads B, the pieces of the cables and the points of the law twice, the cables' stiffness once, and the tip's section
    for each cable; of some points of the law it computes the stiffness.
    """
    modes, strains, cables, pieces, _, _, points, _ = struct.unpack_from("<8I", blob, 32)
    share = int(struct.unpack_from("<f", blob, len(blob) - 4 * (CABLES_MAX + 1) - -(-pieces // 4) * 4)[0])
    pairs = modes * (modes + 1) // 2
    floats = pairs * (2 * strains + cables) + 6 * pieces * modes + 3 * modes + 9 * modes * (cables + 1)
    floats += 18 * modes * points + min(points, share) * (81 * modes + 9 * pairs // 4)
    return _WAIT * (4 * floats >> _LINE)


def sample_bytes(counts: Sequence[int], time_us: int, force_range: int, rate_range: int) -> bytes:
    """Return a gc_sample (core/imu.h): six counts, accelerometer first, the stamp, and the codes of both ranges."""
    return struct.pack("<6hhBxIBBxx", *counts, 8 * 20, 0, time_us & 0xFFFFFFFF, force_range, rate_range)
