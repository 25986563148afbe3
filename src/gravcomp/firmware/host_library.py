"""The firmware as a shared library of this machine, built at first use and kept by content in ~/.cache/gravcomp/firmware.

The compiler is the one that the product needs anyway for its messages; CC names another.
"""

import ctypes
import functools
import os
import shlex
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

from gravcomp.cache import cache_path, content_key
from gravcomp.environment.errors import SetupError
from gravcomp.firmware.sources import CORE, EXACT, HOST, STANDALONE, WARNINGS, contents, sources

PARTS = (CORE, STANDALONE, HOST)
"""Folders in the library."""

LIBRARY_VARIABLE = "GRAVCOMP_FIRMWARE_LIBRARY"
"""Environment variable that names a library to load in place of the built one, such as one that counts lines."""


class Frame(ctypes.Structure):
    """`gc_frame` of core/frame.h."""

    _fields_ = (
        ("id", ctypes.c_uint16),
        ("length", ctypes.c_uint8),
        ("extended", ctypes.c_uint8),
        ("data", ctypes.c_uint8 * 8),
    )


@functools.cache
def load() -> ctypes.CDLL:
    """Return the library with the types of the functions in boards/host/host.h. Raises SetupError, ConfigError."""
    library = ctypes.CDLL(os.environ.get(LIBRARY_VARIABLE) or str(build()))
    memory, frame = ctypes.c_void_p, ctypes.POINTER(Frame)
    u8, u32, flag, i16 = ctypes.c_uint8, ctypes.c_uint32, ctypes.c_bool, ctypes.c_int16
    for name, result, arguments in (
        ("size", ctypes.c_size_t, ()),
        ("loop_size", ctypes.c_size_t, ()),
        ("start", None, (memory, ctypes.POINTER(u32), u8)),
        ("attach", None, (memory, memory)),
        ("loop_read", None, (memory, memory)),
        ("put_model", None, (memory, ctypes.c_char_p, ctypes.c_size_t)),
        ("lose_supply_after", None, (memory, u32)),
        ("set", flag, (memory, u32, u32)),
        ("get", u32, (memory, u32)),
        ("advance", None, (memory, u32)),
        ("receive", None, (memory, u32, frame)),
        ("sample", None, (memory, ctypes.POINTER(i16), i16, u32)),
        ("transmit", flag, (memory, u32, frame)),
        ("bus_off", None, (memory, u32, flag)),
        ("duty", u32, (memory,)),
        ("faults", u32, (memory,)),
    ):
        function = getattr(library, f"gc_host_{name}")
        function.restype, function.argtypes = result, arguments
    return library


def build() -> Path:
    """Return the library's file, compiled when it is missing or out of date. Raises SetupError, ConfigError."""
    compiler = host_compiler()
    options = ["-O2", "-g", "-fPIC", "-shared"]
    path = cache_path("firmware", content_key(*contents(*PARTS), " ".join([*compiler, *options, *WARNINGS, *EXACT])), ".so")
    if not path.exists():
        partial = path.with_suffix(f".{os.getpid()}")
        compile_files(compiler, sources(*PARTS), partial, options)
        partial.replace(path)
    return path


def host_compiler() -> list[str]:
    """Return the command of this machine's C compiler. Raises SetupError without one."""
    given = os.environ.get("CC")
    if given:
        return shlex.split(given)
    for name in ("gcc", "cc", "clang"):
        if shutil.which(name):
            return [name]
    raise SetupError("a C compiler is missing on this machine: it builds the board's firmware. Run: apt-get install gcc")


def compile_files(
    compiler: Sequence[str], files: Sequence[Path], target: Path, options: Sequence[str], folder: Path | None = None
) -> None:
    """Compile and link `files` into `target`; what else the compiler writes goes into `folder`. Raises SetupError."""
    with tempfile.TemporaryDirectory(prefix="gravcomp-") as scratch:
        command = [*compiler, *WARNINGS, *EXACT, *options, *map(str, files), "-o", str(target)]
        done = subprocess.run(command, capture_output=True, text=True, cwd=folder or scratch)
    if done.returncode != 0:
        raise SetupError(f"the firmware does not compile with {compiler[0]}:\n{done.stderr.strip()[-4000:]}")
