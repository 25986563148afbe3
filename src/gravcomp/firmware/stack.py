"""The largest stack that an image can need: frames of the functions along the deepest chain of calls, with its interrupts.

The frame of each function comes from the compiler (-fstack-usage), the calls from the machine code. A call through a pointer is
taken to go to any of the functions that are named here. Recursion is an error.
"""

import functools
from collections.abc import Mapping

from gravcomp.environment.errors import SetupError
from gravcomp.firmware.elf import read_elf
from gravcomp.firmware.image import BOOT_START, CODE_START, Image
from gravcomp.firmware.toolchain import provide

INTERRUPT_FRAME = 108
"""Bytes that the processor saves with its FPU registers, and at most four for alignment."""

_INTERRUPTS = (
    ("gc_on_tick", "gc_on_data_ready", "gc_on_host_sent", "gc_on_motor_sent"),
    ("gc_on_host_frame", "gc_on_motor_frame", "gc_on_edge"),
)
"""Handlers by priority: on the stack can be the main loop and one of each priority."""

_POINTED = (
    "erase_parameters", "write_parameters", "erase_model", "write_model", "gc_model_store_receive", "alive",
)  # fmt: skip
"""Functions whose addresses are taken: where a call through a pointer may go."""

_THUNK = "Thunk_"  # what the linker puts between code in the flash and in RAM, with the name of the target behind it


def largest_stack(image: Image) -> int:
    """Return the bytes. Raises SetupError for recursion."""
    calls = calls_of(image)
    frames = image.frames

    @functools.cache
    def depth(name: str) -> int:
        return frames.get(name, 0) + max((depth(callee) for callee in calls.get(name, ())), default=0)

    _refuse_recursion(calls)
    start = depth("gc_reset")  # it calls main
    interrupts = sum(INTERRUPT_FRAME + max(depth(name) for name in names) for names in _INTERRUPTS)
    return start + interrupts


def calls_of(image: Image) -> dict[str, set[str]]:
    """Return the functions that each function of the image calls, or goes on to."""
    provide()
    import capstone

    symbols = read_elf(image.path.read_bytes()).symbols
    functions = {address & ~1: name for name, address in symbols.items() if address & 1}
    starts = sorted(functions)
    disassembler = capstone.Cs(capstone.CS_ARCH_ARM, capstone.CS_MODE_THUMB | capstone.CS_MODE_MCLASS)
    disassembler.skipdata = True
    result: dict[str, set[str]] = {name: set() for name in functions.values()}
    ends = dict(zip(starts, [*starts[1:], CODE_START + len(image.code)]))
    for start in starts:
        name = functions[start]
        part, base = (image.code, CODE_START) if start >= CODE_START else (image.boot, BOOT_START)
        if not base <= start < base + len(part):
            result[name].update({"wait"} - {name})  # in RAM, while the flash is written
            continue
        if _THUNK in name:
            result[name].add(name.partition(_THUNK)[2])
            continue
        for _, _, mnemonic, operands in disassembler.disasm_lite(part[start - base : ends[start] - base], start):
            if mnemonic.startswith(("bl", "b")) and operands.startswith("#"):
                target = int(operands[1:], 16) & ~1
                if target in functions and target != start:
                    result[name].add(functions[target])
                elif target == start and mnemonic == "bl":
                    raise SetupError(f"{name} calls itself")
            elif mnemonic == "blx":
                result[name].update(pointed for pointed in _POINTED if pointed in result)
    return result


def _refuse_recursion(calls: Mapping[str, set[str]]) -> None:
    done: set[str] = set()

    def visit(name: str, path: tuple[str, ...]) -> None:
        if name in path:
            raise SetupError(f"the firmware calls itself: {' -> '.join([*path[path.index(name) :], name])}")
        if name in done:
            return
        for callee in sorted(calls.get(name, ())):
            visit(callee, (*path, name))
        done.add(name)

    for name in sorted(calls):
        visit(name, ())
