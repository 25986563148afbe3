"""The cross compiler and the emulator: Zig, Unicorn and Capstone from PyPI, pinned, in a folder of their own in .workspace.

They take 480 MB on the disk, and the product does not need them: `./gravcomp firmware install`, and the first command that needs
them, installs them. Zig is chosen because one pinned wheel contains compiler, linker and run-time library for every host and
target; Debian's gcc-arm-none-eabi needs root and another version on each release.
"""

import contextlib
import os
import sys
from pathlib import Path

from gravcomp.environment.errors import SetupError
from gravcomp.environment.packages import is_provided, provide_lock
from gravcomp.firmware.sources import firmware_folder

LOCK = "requirements-firmware.lock"
INSTALL_LINE = "./gravcomp firmware install"


def tools_folder() -> Path:
    """Return the folder of the tools. Raises ConfigError outside a clone of the repository."""
    return _root() / ".workspace" / "firmware"


def installed() -> bool:
    """Return whether the pinned tools are there. Raises ConfigError outside a clone of the repository."""
    return is_provided(_root(), LOCK, _stamp())


def provide() -> Path:
    """Return the folder of the tools, installed when they are missing. Raises SetupError, ConfigError."""
    folder = tools_folder()
    notice = "Installing the firmware's tools: Zig, Unicorn (100 MB to load, 480 MB on the disk)"
    provide_lock(_root(), LOCK, "Firmware's tools", _stamp(), folder / "packages", notice)
    if str(folder / "packages") not in sys.path:
        sys.path.append(str(folder / "packages"))
    return folder


def zig() -> tuple[list[str], dict[str, str]]:
    """Return the command of the C compiler and its environment. Raises SetupError, ConfigError."""
    folder = provide()
    program = folder / "packages" / "ziglang" / "zig"
    if not program.exists():
        raise SetupError(f"{program} is missing. Run: {INSTALL_LINE}")
    with contextlib.suppress(OSError):
        program.chmod(program.stat().st_mode | 0o111)
    cache = str(folder / "cache")
    return [str(program), "cc"], dict(os.environ, ZIG_GLOBAL_CACHE_DIR=cache, ZIG_LOCAL_CACHE_DIR=cache)


def _root() -> Path:
    return firmware_folder().parent.parent


def _stamp() -> Path:
    return tools_folder() / "packages.key"
