"""What clang-tidy finds in the firmware's C code, with the checks of gravcomp_hw/firmware/.clang-tidy.

What it has found is kept by content in ~/.cache/gravcomp/firmware, as what is built from the code is.
"""

import json
import subprocess
import sys
from importlib import metadata
from pathlib import Path

from gravcomp.cache import cache_path, content_key
from gravcomp.environment.errors import SetupError
from gravcomp.environment.packages import provide_extra
from gravcomp.firmware.fuzzing import TESTS
from gravcomp.firmware.sources import CHIP, CORE, HOST, STANDALONE, contents, firmware_folder, sources
from gravcomp.whole_file import write_whole

_PARTS = (CORE, STANDALONE, HOST, CHIP, TESTS)
_OPTIONS = ("-std=c11", "-ffreestanding", "-DGC_WITH_STANDALONE")


def findings() -> list[str]:
    """Return what is found, a line each. Raises SetupError where the checker cannot run."""
    root = firmware_folder().parent.parent
    provide_extra("clang", root)
    program = Path(sys.prefix) / "bin" / "clang-tidy"
    if not program.exists():
        raise SetupError(f"{program} is missing, which checks the C code; it comes with requirements-clang.lock")
    checks = (firmware_folder() / ".clang-tidy").read_bytes()
    kept = cache_path(
        "firmware", content_key(*contents(*_PARTS), checks, metadata.version("clang-tidy"), " ".join(_OPTIONS)), ".findings"
    )
    if kept.exists():
        return list(json.loads(kept.read_text(encoding="utf-8")))
    files = sources(*_PARTS)
    done = subprocess.run([str(program), "--quiet", *map(str, files), "--", *_OPTIONS], capture_output=True, text=True)
    found = [line.removeprefix(f"{root}/") for line in done.stdout.splitlines() if ": error: " in line or ": warning: " in line]
    if done.returncode != 0 and not found:
        raise SetupError(f"clang-tidy ends with {done.returncode}: {done.stderr.strip()[-500:]}")
    write_whole(kept, json.dumps(found))
    return found
