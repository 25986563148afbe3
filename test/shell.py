"""Run documented lines as a reader does: commands that run until Ctrl-C, and a folder that looks like the repository."""

import os
import re
import shutil
import signal
import subprocess
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from typing import TypeVar

Ended = TypeVar("Ended")
START = 300.0  # s; a machine that has never run the graph compiles first


def mirror(source: Path, target: Path, written: list[Path]) -> None:
    """Fill `target` with links to everything in `source`; the files `written` and the folders that contain them are copies."""
    target.mkdir(exist_ok=True)
    for path in source.iterdir():
        below = [Path(*w.parts[1:]) for w in written if w.parts[0] == path.name and len(w.parts) > 1]
        if below:
            mirror(path, target / path.name, below)
        elif Path(path.name) in written:
            shutil.copy(path, target / path.name)
        elif path.name not in (".git", "__pycache__"):
            (target / path.name).symlink_to(path)


def check_doctor(code: int, output: str) -> None:
    """Check what `doctor --graph` says of a graph that runs. On a slow machine a topic is below its rate, which is `missing`."""
    assert "cable/command" in output and "nothing is published" not in output, output
    levels = re.findall(r"^ *(ok|optional|missing) ", output, re.MULTILINE)
    assert "ok" in levels and code == ("missing" in levels), output


def future(step: Callable, *given: object) -> Future:
    """Return what a step returned or raised: a fixture keeps it for the test that checks it, in which `result()` raises it."""
    done: Future = Future()
    try:
        done.set_result(step(*given))
    except Exception as error:
        done.set_exception(error)
    return done


def unless_stopped(run: Callable[[], Ended], code: Callable[[Ended], int]) -> Ended:
    """Return what the run of a graph returned; of a second one where the first ended with code 2.

    A graph that a busy machine has stopped cannot be measured, which is code 2: the bridge stops the motors where it loses their
    feedback. A defect gives it twice.
    """
    ended = run()
    return run() if code(ended) == 2 else ended


class Shell:
    """A command that runs in the background, until Ctrl-C or to its end."""

    def __init__(self, words: list[str], cwd: Path, environment: dict[str, str]):
        handle, name = tempfile.mkstemp(prefix="output_", dir=cwd)
        os.close(handle)
        self.output = Path(name)
        with open(self.output, "w", encoding="utf-8") as output:
            self.process = subprocess.Popen(
                words, cwd=cwd, stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT, env=environment,
                start_new_session=True, preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL))  # fmt: skip

    def wait_for(self, sentence: str) -> None:
        end = time.monotonic() + START
        while sentence not in self.output.read_text(encoding="utf-8"):
            assert self.process.poll() is None and time.monotonic() < end, self.output.read_text(encoding="utf-8")
            time.sleep(0.1)

    def end(self, patience: float = START) -> tuple[int, str]:
        """Return exit code and output of a command that ends by itself."""
        code = self._wait(patience)
        return code, self.output.read_text(encoding="utf-8")

    def ctrl_c(self) -> int:
        self.process.send_signal(signal.SIGINT)
        return self._wait(60.0)

    def _wait(self, patience: float) -> int:
        try:
            return self.process.wait(patience)
        except subprocess.TimeoutExpired:
            os.killpg(self.process.pid, signal.SIGKILL)
            raise
