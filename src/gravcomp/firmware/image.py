"""The image for the STM32F407: compiled and linked by Zig, with the header by which the board recognises that it is whole.

The same sources and tools give the same bytes: paths and times do not enter the image.
"""

import dataclasses
import os
import struct
import subprocess
import tempfile
import zlib
from pathlib import Path

from gravcomp.cache import cache_path, content_key
from gravcomp.environment.errors import SetupError
from gravcomp.firmware.elf import read_elf
from gravcomp.firmware.sources import CHIP, CORE, EXACT, STANDALONE, WARNINGS, contents, firmware_folder, sources
from gravcomp.firmware.toolchain import LOCK, zig

BOOT_START, CODE_START = 0x08000000, 0x08010000
_TARGET = ("-target", "thumb-freestanding-eabihf", "-mcpu=cortex_m4+vfp4d16sp")
_OPTIONS = (
    "-ffreestanding", "-fno-sanitize=undefined", "-ffunction-sections", "-fdata-sections", "-fno-unwind-tables",
    "-fno-asynchronous-unwind-tables", "-fno-stack-protector", "-fno-builtin", "-g0", "-fstack-usage",
)  # fmt: skip
_HEADER = struct.Struct("<5I")
_MAGIC = 0x474D4947


@dataclasses.dataclass(frozen=True)
class Image:
    """A built image. `path`: the ELF file; frames: stack in bytes by function, the largest where several have one name."""

    path: Path
    boot: bytes
    code: bytes
    ram: int
    ccm: int
    frames: dict[str, int]

    @property
    def flash(self) -> int:
        """Bytes in the flash."""
        return len(self.boot) + len(self.code)

    @property
    def check(self) -> int:
        """CRC-32 of the code, by which a board names its image."""
        return zlib.crc32(self.code)


def build_image(*, standalone: bool = False, fresh: bool = False) -> Image:
    """Return the image, built when it is missing or out of date, or when `fresh`. Raises SetupError, ConfigError.

    standalone: with the loop on the board.
    """
    parts = [CORE, CHIP, *([STANDALONE] if standalone else [])]
    lock = (firmware_folder().parent.parent / LOCK).read_bytes()
    key = content_key(*contents(*parts), lock, " ".join([*_TARGET, *_OPTIONS, *WARNINGS, *EXACT]), standalone)
    path = cache_path("firmware", key, ".elf")
    usage = path.with_suffix(".stack")
    if fresh or not path.exists() or not usage.exists():
        _build(parts, standalone, path, usage)
    elf = read_elf(path.read_bytes())
    boot, code = elf.flash(BOOT_START), elf.flash(CODE_START)
    frames: dict[str, int] = {}
    for name, size in (line.split() for line in usage.read_text(encoding="utf-8").splitlines()):
        frames[name] = max(int(size), frames.get(name, 0))
    return Image(path, boot, code, elf.size("gc_data_start", "gc_bss_end"), elf.size("gc_ccm_start", "gc_ccm_end"), frames)


def _build(parts: list[str], standalone: bool, path: Path, usage: Path) -> None:
    command, environment = zig()
    folder = firmware_folder()
    with tempfile.TemporaryDirectory(prefix="gravcomp-") as name:
        scratch = Path(name)
        objects, frames = [], []
        # The report of the use of the stack stays in the cache: this build has one of its own.
        own = dict(environment, ZIG_LOCAL_CACHE_DIR=str(scratch / "cache"))
        for source in sources(*parts):
            target = scratch / f"{'-'.join(source.relative_to(folder).with_suffix('').parts)}.o"
            speed = "-O2" if source.parent.name == STANDALONE else "-Os"
            define = ["-DGC_WITH_STANDALONE"] if standalone else []
            _run([*command, *_TARGET, *WARNINGS, *EXACT, *_OPTIONS, speed, *define, f"-ffile-prefix-map={folder}=.",
                  "-c", str(source), "-o", str(target)], own)  # fmt: skip
            objects.append(str(target))
        for report in sorted((scratch / "cache").rglob("*.su")):
            frames += [_frame(line) for line in report.read_text(encoding="utf-8").splitlines()]
        linked = scratch / "image.elf"
        script = folder / CHIP / "image.ld"
        _run([*command, *_TARGET, "-static", "-nostdlib", "-T", str(script), "-Wl,--gc-sections", *objects,
              "-o", str(linked)], environment)  # fmt: skip
        partial = path.with_suffix(f".{os.getpid()}")
        partial.write_bytes(_with_header(linked.read_bytes()))
        usage.write_text("".join(f"{name} {size}\n" for name, size in sorted(frames)), encoding="utf-8")
        partial.replace(path)


def _with_header(data: bytes) -> bytes:
    """Return the ELF file with sizes and checks in the header of the image."""
    elf = read_elf(data)
    boot, code = elf.flash(BOOT_START), elf.flash(CODE_START)
    at = elf.symbols["gc_image"] - BOOT_START
    behind = boot[at + _HEADER.size : elf.symbols["gc_boot_end"] - BOOT_START]
    header = _HEADER.pack(_MAGIC, len(code), zlib.crc32(code), len(behind), zlib.crc32(behind))
    offset = elf.offset(elf.symbols["gc_image"])
    return data[:offset] + header + data[offset + _HEADER.size :]


def _frame(line: str) -> tuple[str, str]:
    """Return the function and the bytes in a line of -fstack-usage: place:function, bytes, kind."""
    place, size, kind = line.split("\t")
    if kind.strip() != "static":
        raise SetupError(f"{place}: the use of the stack is {kind.strip()}; allowed: static")
    return place.rsplit(":", 1)[-1], size


def _run(command: list[str], environment: dict[str, str]) -> None:
    done = subprocess.run(command, capture_output=True, text=True, env=environment)
    if done.returncode != 0:
        raise SetupError(f"the firmware's image cannot be built:\n{done.stderr.strip()[-4000:]}")
