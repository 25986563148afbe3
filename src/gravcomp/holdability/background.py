"""The answer for one direction of gravity from a process of low priority, for a loop that must not wait.

question = HoldProcess(robot, gravity, target)      # forks: the answer needs what this process has imported
verdict = question.poll()                           # None until it is known
"""

import gc
import json
import os
import signal
import warnings
from typing import NamedTuple, NoReturn

import numpy as np

from gravcomp.description import Robot
from gravcomp.environment.end_with_parent import end_with_parent
from gravcomp.environment.give_way import give_way
from gravcomp.environment.process_title import set_title
from gravcomp.inverse.target import Target


class Verdict(NamedTuple):
    """Whether the tip can be held, and the answer as a sentence."""

    held: bool
    sentence: str


class HoldProcess:
    """The process that answers for a robot, one gravity (3,) in m/s^2 and a target."""

    def __init__(self, robot: Robot, gravity: np.ndarray, target: Target):
        """target: of its tip, without weights on the backbone."""
        parent = os.getpid()
        self._answer, writing = os.pipe()
        self._status: int | None = None
        with warnings.catch_warnings():
            # Other threads are of ROS, which the forked process does not use.
            warnings.simplefilter("ignore", DeprecationWarning)
            self._pid = os.fork()
        if not self._pid:
            _answer_and_end(robot, gravity, target, writing, parent)
        os.close(writing)

    @property
    def running(self) -> bool:
        """Whether an answer may still come."""
        if self._status is None:
            ended, status = os.waitpid(self._pid, os.WNOHANG)
            self._status = status if ended else None
        return self._status is None

    def poll(self) -> Verdict | None:
        """Return the answer, once; None before it is known and after it was returned, or if the process failed."""
        if self.running or self._answer < 0:
            return None
        text = self._closed()
        return Verdict(**json.loads(text)) if self._status == 0 and text else None

    def stop(self) -> None:
        """End the process."""
        if self.running:
            os.kill(self._pid, signal.SIGKILL)
            self._status = os.waitpid(self._pid, 0)[1]
        if self._answer >= 0:
            self._closed()

    def _closed(self) -> str:
        """Close the pipe; return what was in it."""
        with os.fdopen(self._answer) as stream:
            self._answer = -1
            return stream.read()


def _answer(robot: Robot, gravity: np.ndarray, target: Target) -> Verdict:
    """Return the answer. Raises MeshError, ValueError."""
    from gravcomp.holdability import holdability
    from gravcomp.holdability.text import sentence

    of_tip = Target(target.tip_position, tip_direction=target.tip_direction)
    found = holdability(robot, of_tip, directions=gravity[None], with_needed=False)
    return Verdict(found.held, sentence(robot, found))


def _answer_and_end(robot: Robot, gravity: np.ndarray, target: Target, writing: int, parent: int) -> NoReturn:
    """Write the answer to a pipe in the forked process, and end it without the destructors of what belongs to its parent."""
    code = 1
    try:
        gc.disable()
        os.setsid()  # Ctrl-C reaches the launcher alone
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.SIG_DFL)
        signal.set_wakeup_fd(-1)
        end_with_parent()
        if os.getppid() != parent:  # it ended before
            os._exit(1)
        os.dup2(writing, 3)
        os.closerange(4, os.sysconf("SC_OPEN_MAX"))
        nothing = os.open(os.devnull, os.O_RDWR)
        for standard in range(3):
            os.dup2(nothing, standard)
        set_title("holdability", ["holdability", robot.name])
        give_way()
        os.write(3, json.dumps(_answer(robot, gravity, target)._asdict()).encode())
        code = 0
    finally:
        os._exit(code)
