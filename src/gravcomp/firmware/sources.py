"""Where the C code of the firmware is, and the options with which every compiler reads it."""

import os
from collections.abc import Sequence
from pathlib import Path

from gravcomp.config import ConfigError

CORE, STANDALONE, HOST, CHIP = "core", "standalone", "boards/host", "boards/stm32f407"
"""Folders of the code: what no hardware concerns, the loop on the board, the board as a library, the STM32F407."""

WARNINGS = (
    "-std=c11", "-Wall", "-Wextra", "-Wconversion", "-Wdouble-promotion", "-Wshadow", "-Wstrict-prototypes",
    "-Wmissing-prototypes", "-Wcast-qual", "-Wvla", "-Werror",
)  # fmt: skip

EXACT = ("-ffp-contract=off", "-fno-fast-math", "-fno-math-errno", "-fno-strict-aliasing")
"""A host and the chip round alike."""


def firmware_folder() -> Path:
    """Return the folder of the C code. Raises ConfigError where gravcomp runs outside its repository."""
    root = Path(os.environ.get("GRAVCOMP_ROOT") or Path(__file__).resolve().parents[3])
    folder = root / "gravcomp_hw" / "firmware"
    if not (folder / CORE).is_dir():
        raise ConfigError(f"{folder} has no firmware: it is built from a clone of the repository")
    return folder


def sources(*parts: str, suffixes: Sequence[str] = (".c",)) -> list[Path]:
    """Return the files of these folders in a fixed order. Raises ConfigError without the folder of the firmware."""
    folder = firmware_folder()
    return sorted(path for part in parts for path in (folder / part).glob("*") if path.suffix in suffixes)


def contents(*parts: str) -> list[bytes]:
    """Return names and contents of all files of these folders, as a key of what is built from them."""
    folder = firmware_folder()
    files = sorted(path for part in parts for path in (folder / part).glob("*") if path.is_file())
    return [f"{path.relative_to(folder)}\n".encode() + path.read_bytes() for path in files]
