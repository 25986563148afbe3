"""The answer for one direction of gravity from a process of low priority, for a loop that must not wait.

question = HoldProcess(robot, gravity, target)      # forks: the answer needs what this process has imported
verdict = question.poll()                           # None until it is known

A fork copies the locks of the process, but not its other threads: those of ROS and of the late reduction. A lock that one of them
holds at that moment, for instance that of Numba's compiler, stays locked in the forked process. So the kernel ends a process that
has not answered in time.
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

_LONGEST = 1800  # s until a process without an answer is ended: it computes for seconds, but has the lowest priority


class Verdict(NamedTuple):
    """Whether the tip can be held, and the answer as a sentence."""

    held: bool
    sentence: str


class HoldProcess:
    """The process that answers for a robot, one gravity (3,) in m/s^2 and a target. Raises nothing: a failure has no answer."""

    def __init__(self, robot: Robot, gravity: np.ndarray, target: Target):
        """target: of its tip, without weights on the backbone."""
        self._answer, self._pid = -1, 0
        self._status: int | None = None
        try:
            self._start(robot, gravity, target)
        except OSError:  # no memory, or too many processes or files
            self._status = 1

    @property
    def running(self) -> bool:
        """Whether an answer may still come."""
        if self._status is None:
            self._wait(os.WNOHANG)
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
            self._wait(0)
        if self._answer >= 0:
            self._closed()

    def _start(self, robot: Robot, gravity: np.ndarray, target: Target) -> None:
        """Fork. Raises OSError."""
        parent = os.getpid()
        self._answer, writing = os.pipe()
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", DeprecationWarning)  # of the other threads, see above
                self._pid = os.fork()
            if not self._pid:
                _answer_and_end(robot, gravity, target, writing, parent)
        finally:
            os.close(writing)

    def _wait(self, how: int) -> None:
        try:
            ended, status = os.waitpid(self._pid, how)
        except ChildProcessError:  # other code of this process has waited for it
            ended, status = self._pid, 1
        if ended:
            self._status = status

    def _closed(self) -> str:
        """Close the pipe; return what was in it."""
        with os.fdopen(self._answer, encoding="utf-8") as stream:
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
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGALRM):
            signal.signal(number, signal.SIG_DFL)
        signal.set_wakeup_fd(-1)
        signal.pthread_sigmask(signal.SIG_SETMASK, ())
        signal.alarm(_LONGEST)
        end_with_parent(signal.SIGKILL)
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
