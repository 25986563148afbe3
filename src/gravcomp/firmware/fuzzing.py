"""The fuzzer of the firmware's frames (gravcomp_hw/firmware/tests), built with GCC's sanitizers and run on the corpus there."""

import dataclasses
import json
import os
import shutil
import subprocess
import tempfile
from pathlib import Path

from gravcomp.cache import cache_path, content_key
from gravcomp.environment.errors import SetupError
from gravcomp.firmware.host_library import PARTS, compile_files, host_compiler
from gravcomp.firmware.sources import EXACT, WARNINGS, contents, firmware_folder, sources

TESTS, CORPUS = "tests", "tests/corpus"
_SANITIZERS = ("-O1", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
_TRACE = "-fsanitize-coverage=trace-pc"
_DRIVER = "fuzz.c"


@dataclasses.dataclass(frozen=True)
class Fuzzed:
    """What a run has found.

    frames, samples: given to the board; violations: of what must hold; edges: branches reached; found: inputs that reached new
    ones; fault: what a sanitizer says, empty: nothing.
    """

    frames: int = 0
    samples: int = 0
    answers: int = 0
    violations: int = 0
    edges: int = 0
    found: int = 0
    fault: str = ""


def fuzz(frames: int, seed: int, out: Path | None = None) -> Fuzzed:
    """Give the board at least so many frames; write inputs that reach new code into `out`. Raises SetupError without GCC."""
    inputs = sorted((firmware_folder() / CORPUS).glob("*.bin"))
    command = [str(build_fuzzer()), str(frames), str(seed), str(out or "-"), *map(str, inputs)]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        lines = [line for line in done.stderr.splitlines() if "ERROR" in line or "runtime error" in line]
        return Fuzzed(fault=lines[0] if lines else f"ended with {done.returncode}: {done.stderr.strip()[-500:]}")
    return Fuzzed(**json.loads(done.stdout))


def build_fuzzer() -> Path:
    """Return the program, built when it is missing or out of date. Raises SetupError."""
    compiler = host_compiler()
    if not shutil.which(compiler[0]):
        raise SetupError(f"{compiler[0]} is not there: the fuzzer needs GCC with its sanitizers. Run: apt-get install gcc")
    options = " ".join([*compiler, *WARNINGS, *EXACT, *_SANITIZERS, _TRACE])
    path = cache_path("firmware", content_key(*contents(*PARTS, TESTS), options), ".fuzz")
    if path.exists():
        return path
    driver = [file for file in sources(TESTS) if file.name == _DRIVER]
    traced = [*sources(*PARTS), *(file for file in sources(TESTS) if file.name != _DRIVER)]
    with tempfile.TemporaryDirectory(prefix="gravcomp-") as name:
        objects = Path(name) / "board.o"
        compile_files(compiler, traced, objects, [*_SANITIZERS, _TRACE, "-r", "-nostdlib"])
        partial = path.with_suffix(f".{os.getpid()}")
        compile_files(compiler, [*driver, objects], partial, [*_SANITIZERS])
        partial.replace(path)
    return path
