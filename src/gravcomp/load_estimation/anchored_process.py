"""The anchored model in a process of its own, with low priority: a step of it may take longer than the time between samples.

While a question is computed, newer ones are left out: the next one that is asked after the answer is that of the newest sample.
So the owner never waits, not even for a process that is preempted in the middle of an answer or of its end, and what lies in the
connection stays small.
"""

import pickle
import socket
import subprocess
import sys
import tempfile
import time

from gravcomp.description import Robot
from gravcomp.environment.give_way import give_way
from gravcomp.load_estimation.anchored_follower import Answer, Question
from gravcomp.load_estimation.message_pipe import PatientEnd
from gravcomp.scene.scene import Scene

_PAUSE = 5.0  # s between two starts: a process that dies at once must not take the machine's time


class AnchoredProcess:
    """A worker (`anchored_follower`) that does not let its owner wait.

    Attribute sentence: what the user has to know, empty while all is well.
    """

    def __init__(self, robot: Robot, scene: Scene | None = None):
        """robot: as the running model has it; scene: what it touches."""
        self._described = pickle.dumps((robot, scene))
        self.sentence = ""
        self._process, self._connection = self._start()

    def exchange(self, question: Question) -> list[Answer]:
        """Return what has been computed since the last call, and pass this question on, if none is being computed."""
        answers: list[Answer] = []
        if self._process is None:
            if time.monotonic() - self._started < _PAUSE:
                return answers
            try:
                self._process, self._connection = self._start()
            except OSError as error:
                self.sentence = f"the process of the second model does not start: {error}"
                return answers
        try:
            for received in self._connection.received():
                self._busy = False
                self.sentence = ""
                if received is not None and received[0] == self._generation:
                    answers.append(received[1])
            if not self._busy:
                self._connection.send((self._generation, question))
                self._busy = True
        except (EOFError, OSError):
            self._give_up()
        return answers

    def reset(self) -> None:
        """Forget the robot's shape, and what is being computed."""
        self._generation += 1

    def close(self) -> None:
        """End the process."""
        if self._process is not None:
            self._connection.close()
            self._process.kill()
            self._process.wait()
            self._process = None

    @property
    def pid(self) -> int | None:
        """Number of the process; None while there is none."""
        return None if self._process is None else self._process.pid

    def _start(self) -> tuple[subprocess.Popen | None, PatientEnd]:
        """Start the process, which answers None when it is ready; return it and the connection to it."""
        self._started, self._generation, self._busy = time.monotonic(), 0, True
        ours, theirs = socket.socketpair()
        try:
            with theirs, tempfile.TemporaryFile() as described:  # a pipe would let this process wait for the other's imports
                described.write(self._described)
                described.seek(0)
                process = subprocess.Popen(
                    [sys.executable, "-m", "gravcomp.load_estimation.anchored_worker", str(theirs.fileno())],
                    stdin=described,
                    stdout=subprocess.DEVNULL,
                    pass_fds=[theirs.fileno()],
                    start_new_session=True,  # Ctrl-C reaches its owner alone
                )
        except OSError:
            ours.close()
            raise
        give_way(process=process.pid)  # not before it runs: this process would wait for one of low priority
        return process, PatientEnd(ours)

    def _give_up(self) -> None:
        """Let go of a process that has ended, or is about to: its exit code may be known at a later call only."""
        assert self._process is not None
        self._connection.close()
        self._process.kill()
        code = self._process.poll()
        if code is not None:
            self._process = None
            self.sentence = f"the process of the second model has ended (exit code {code}); it is started again"
