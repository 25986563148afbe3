"""The process that builds a robot's reduced model while its nodes already run on the full model.

To see that the model is stored, the process imports and meshes for a second, next to nodes that have just started; where these
take the whole machine, it does not come to that before a short run ends. So a note in the cache, under a key of the robot and of
this package's code, names the stored file with its time of writing (another robot with the same ratios of its moduli may replace
it); as long as they are right, no process is started. The note is of the process, or of `gravcomp model build`.
"""

import contextlib
import os
import subprocess
import sys
from pathlib import Path

from gravcomp.cache import cache_path, content_key
from gravcomp.compiled_functions import PACKAGE
from gravcomp.description import load_robot_file
from gravcomp.environment.end_with_parent import end_with_parent
from gravcomp.whole_file import write_whole

MARK = "GRAVCOMP_MODEL_BUILDER"
"""Environment variable that tells nodes that their launcher builds the reduced model."""


class ModelBuilder:
    """Builds the reduced model of `robot` (a shipped name or a path) in a process of low priority, from `start` on.

    The process ends with the context. A build that is interrupted goes on at the next start (`gravcomp.training.background`).
    `environment`: variables for the nodes of the graph.
    """

    def __init__(self, robot: str):
        self._robot = robot
        self._process: subprocess.Popen | None = None
        self._note: Path | None = None
        self.environment = {MARK: "1"}

    def __enter__(self) -> "ModelBuilder":
        return self

    def start(self) -> None:
        """Start the process, unless the model is known to be stored. Raises ConfigError.

        Call it when the nodes have started: their imports and its own would wait for each other.
        """
        self._note = note_of(self._robot)
        if not is_stored(self._note):
            self._process = start_builder(self._robot, subprocess.PIPE)

    @property
    def builds(self) -> bool:
        """Whether the reduced model is being built."""
        return self._process is not None and self._process.poll() is None

    def __exit__(self, *_: object) -> None:
        if self._process is None:
            return
        if self._process.poll() is None:
            self._process.terminate()
        stored, _errors = self._process.communicate()
        if self._process.returncode == 0 and stored:
            _write(self._note, stored.strip())


def note_of(robot: str) -> Path | None:
    """Return the path of the note about a robot's stored model; None for a body from a file, which can change by itself.

    Raises ConfigError.
    """
    described = load_robot_file(robot).robot
    if described.body is not None:
        return None
    code = sorted((str(path.relative_to(PACKAGE)), path.stat().st_mtime_ns) for path in PACKAGE.rglob("*.py"))
    return cache_path("reduction", content_key(described, code), ".stored")


def is_stored(note: Path | None) -> bool:
    """Return whether a note names a file as it is there."""
    try:
        written, path = note.read_text(encoding="utf-8").split(" ", 1) if note else ("", "")
        return bool(path) and Path(path).stat().st_mtime_ns == int(written)
    except (OSError, ValueError):
        return False


def note_stored(robot: str, path: Path) -> None:
    """Note that the reduced model of `robot` is stored at `path`: its next graph starts no process to find that out.

    Raises ConfigError.
    """
    note = note_of(robot)
    with contextlib.suppress(OSError):  # somebody has just deleted the file
        _write(note, f"{path.stat().st_mtime_ns} {path}")


def _write(note: Path | None, text: str) -> None:
    with contextlib.suppress(OSError):  # a full disk: the next start looks again
        if note is not None:
            write_whole(note, text)


def start_builder(robot: str, output: int = subprocess.DEVNULL) -> subprocess.Popen:
    """Start the building process; it ends by itself, or with the thread that calls this. Its progress goes to stderr.

    output: where it writes time and path of the stored model (`subprocess`).
    """
    return subprocess.Popen(
        [sys.executable, "-m", "gravcomp.training.background", robot],
        stdin=subprocess.DEVNULL,
        stdout=output,
        text=True,
        start_new_session=True,  # Ctrl-C reaches the launcher alone
        preexec_fn=end_with_parent,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"},
    )
