"""Which lines of the firmware's C code the tests reach: GCC's counters in the shared library and in the fuzzer's inputs."""

import dataclasses
import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from gravcomp.environment.errors import SetupError
from gravcomp.firmware.fuzzing import CORPUS, TESTS
from gravcomp.firmware.host_library import LIBRARY_VARIABLE, PARTS, compile_files, host_compiler
from gravcomp.firmware.sources import firmware_folder, sources

_OPTIONS = ("-O0", "-g", "--coverage", "-fPIC")


@dataclasses.dataclass(frozen=True)
class Coverage:
    """Lines with code, lines reached, and the lines not reached, by file."""

    lines: int
    reached: int
    missed: dict[str, list[int]]

    @property
    def percent(self) -> float:
        """Share of the lines that are reached, in per cent."""
        return round(100.0 * self.reached / self.lines, 1) if self.lines else 0.0


def measure(tests: list[str], root: Path, names: str = "") -> Coverage:
    """Run pytest on `tests` and the fuzzer's corpus with counters; return what they reach. Raises SetupError.

    names: of the tests, as pytest's -k takes them; empty: all.
    """
    if not shutil.which("gcov"):
        raise SetupError("gcov is missing, which counts the lines that are reached. Run: apt-get install gcc")
    compiler = host_compiler()
    with tempfile.TemporaryDirectory(prefix="gravcomp-") as name:
        folder = Path(name)
        objects, library, corpus = folder / "board.o", folder / "board.so", folder / "corpus"
        compile_files(compiler, sources(*PARTS), objects, [*_OPTIONS, "-r", "-nostdlib"], folder)
        compile_files(compiler, [objects], library, [*_OPTIONS, "-shared"], folder)
        compile_files(compiler, [objects, *sources(TESTS)], corpus, [*_OPTIONS], folder)
        environment = dict(os.environ, **{LIBRARY_VARIABLE: str(library)})
        options = ["-q", "-p", "no:cacheprovider", "-p", "no:randomly", "-n", "0", "-k", names]
        command = [sys.executable, "-m", "pytest", *options, *tests]
        done = subprocess.run(command, cwd=root, env=environment, capture_output=True, text=True)
        if done.returncode != 0:
            raise SetupError(f"the firmware's tests fail:\n{done.stdout.strip()[-3000:]}")
        inputs = sorted((firmware_folder() / CORPUS).glob("*.bin"))
        subprocess.run([str(corpus), "0", "1", "-", *map(str, inputs)], capture_output=True, check=True)
        return _read(folder)


def _read(folder: Path) -> Coverage:
    reached: dict[str, dict[int, bool]] = {}
    counters = sorted(str(path) for path in folder.glob("*.gcda"))
    done = subprocess.run(
        ["gcov", "--json-format", "--stdout", *counters], cwd=folder, capture_output=True, text=True, check=True
    )
    wanted = {str(path) for path in sources(*PARTS, suffixes=(".c", ".h"))}
    for report in done.stdout.splitlines():
        for file in json.loads(report)["files"] if report.strip() else ():
            path = str((Path(folder) / file["file"]).resolve())
            if path in wanted:
                own = reached.setdefault(path, {})
                for line in file["lines"]:
                    own[line["line_number"]] = own.get(line["line_number"], False) or line["count"] > 0
    missed = {
        str(Path(path).relative_to(firmware_folder())): sorted(line for line, hit in lines.items() if not hit)
        for path, lines in sorted(reached.items())
    }
    return Coverage(
        lines=sum(len(lines) for lines in reached.values()),
        reached=sum(sum(lines.values()) for lines in reached.values()),
        missed={path: lines for path, lines in missed.items() if lines},
    )
