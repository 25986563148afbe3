"""The answer for one direction of gravity from a process of low priority, for a loop that must not wait.

question = HoldProcess("article", gravity, target)      # starts `python -m gravcomp.holdability.background`
verdict = question.poll()                               # None until it is known
"""

import json
import os
import subprocess
import sys
from typing import NamedTuple

import numpy as np

from gravcomp.environment.end_with_parent import end_with_parent
from gravcomp.environment.give_way import give_way
from gravcomp.inverse.target import Target


class Verdict(NamedTuple):
    """Whether the tip can be held, and the answer as a sentence."""

    held: bool
    sentence: str


class HoldProcess:
    """The process that answers for a robot file, one gravity (3,) in m/s^2 and a target."""

    def __init__(self, robot: str, gravity: np.ndarray, target: Target):
        """robot: path or shipped name."""
        direction = None if target.tip_direction is None else target.tip_direction.tolist()
        question = {
            "robot": robot,
            "gravity": list(map(float, gravity)),
            "tip": target.tip_position.tolist(),
            "direction": direction,
        }
        self._process = subprocess.Popen(
            [sys.executable, "-m", "gravcomp.holdability.background", json.dumps(question)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            start_new_session=True,  # Ctrl-C reaches the launcher alone
            preexec_fn=end_with_parent,
            env={**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"},
        )

    @property
    def running(self) -> bool:
        """Whether an answer may still come."""
        return self._process.poll() is None

    def poll(self) -> Verdict | None:
        """Return the answer, once; None before it is known and after it was returned, or if the process failed."""
        if self.running or self._process.stdout is None or self._process.stdout.closed:
            return None
        with self._process.stdout as stream:
            lines = stream.read().decode().splitlines()
        return Verdict(**json.loads(lines[-1])) if self._process.returncode == 0 and lines else None

    def stop(self) -> None:
        """End the process."""
        if self.running:
            self._process.terminate()
        self._process.wait()
        if self._process.stdout is not None:
            self._process.stdout.close()


def answer(question: dict) -> Verdict:
    """Return the answer to a question as `HoldProcess` asks it. Raises ConfigError, MeshError, ValueError."""
    from gravcomp.description import load_robot_file
    from gravcomp.holdability import holdability
    from gravcomp.holdability.text import sentence

    robot = load_robot_file(question["robot"]).robot
    direction = question["direction"]
    target = Target(np.array(question["tip"]), tip_direction=None if direction is None else np.array(direction))
    found = holdability(robot, target, directions=np.array([question["gravity"]]), with_needed=False)
    return Verdict(found.held, sentence(robot, found))


if __name__ == "__main__":
    give_way()
    print(json.dumps(answer(json.loads(sys.argv[1]))._asdict()), flush=True)
