"""What clang-tidy finds in the firmware's C code, with the checks of gravcomp_hw/firmware/.clang-tidy."""

import subprocess
import sys
from pathlib import Path

from gravcomp.environment.errors import SetupError
from gravcomp.environment.packages import provide_extra
from gravcomp.firmware.fuzzing import TESTS
from gravcomp.firmware.sources import CHIP, CORE, HOST, STANDALONE, firmware_folder, sources

_OPTIONS = ("-std=c11", "-ffreestanding", "-DGC_WITH_STANDALONE")


def findings() -> list[str]:
    """Return what is found, a line each. Raises SetupError where the checker cannot run."""
    root = firmware_folder().parent.parent
    provide_extra("clang", root)
    program = Path(sys.prefix) / "bin" / "clang-tidy"
    if not program.exists():
        raise SetupError(f"{program} is missing, which checks the C code; it comes with requirements-clang.lock")
    files = sources(CORE, STANDALONE, HOST, CHIP, TESTS)
    done = subprocess.run([str(program), "--quiet", *map(str, files), "--", *_OPTIONS], capture_output=True, text=True)
    found = [line.removeprefix(f"{root}/") for line in done.stdout.splitlines() if ": error: " in line or ": warning: " in line]
    if done.returncode != 0 and not found:
        raise SetupError(f"clang-tidy ends with {done.returncode}: {done.stderr.strip()[-500:]}")
    return found
