"""The bridge's end of the connection to the guard process of joint_bridge, which it starts.

The guard answers heartbeats by a byte. One that has not answered for ANSWER_TIMEOUT hangs: it is killed and replaced.
"""

import contextlib
import os
import select
import subprocess
import sys
import threading
import time

from gravcomp.motors.guard_protocol import ANSWER_TIMEOUT
from gravcomp.motors.joint_guard import BEAT, GOODBYE

_READY_TIMEOUT = 20.0  # s


class JointGuardError(RuntimeError):
    """There is no guard; the text says why."""


class JointGuardClient:
    """A guard process for the controller of efforts on `topic`. Raises JointGuardError when it does not start.

    Attribute pid: of the guard.
    """

    def __init__(self, topic: str, number: int, namespace: str):
        self._command = [sys.executable, "-m", "gravcomp_hw.joint_guard", topic, str(number), namespace]
        self._topic = topic
        self._replacing: threading.Thread | None = None
        self._closed = False
        self._process: subprocess.Popen | None = self._start()

    @property
    def pid(self) -> int | None:
        """Process id of the guard, None while there is none."""
        return None if self._process is None else self._process.pid

    def beat(self) -> bool:
        """Send a heartbeat. Return whether there is a guard; one that hangs is killed, and one that is gone is replaced."""
        process = self._process
        if process is None:
            if self._replacing is not None and not self._replacing.is_alive():
                self._replace_apart(None)
            return False
        now = time.monotonic()
        if self._answered(process):
            self._unanswered = None
        hangs = self._unanswered is not None and now - self._unanswered > ANSWER_TIMEOUT
        if not hangs and self._write(process, BEAT):
            self._unanswered = now if self._unanswered is None else self._unanswered
            return True
        process.kill()
        self._process = None
        self._replace_apart(process)
        return False

    def close(self) -> None:
        """Let the guard end: the bridge has sent its zeros itself."""
        self._closed = True
        if self._replacing is not None:
            self._replacing.join()
        if self._process is not None:
            self._write(self._process, GOODBYE)
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(2.0)

    def _start(self) -> subprocess.Popen:
        process = subprocess.Popen(
            self._command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            bufsize=0,
            start_new_session=True,  # it outlives the bridge's group
        )
        assert process.stdin is not None and process.stdout is not None
        ready = select.select([process.stdout], [], [], _READY_TIMEOUT)[0]
        if not ready or process.stdout.readline().strip() != b"ready":
            process.kill()
            raise JointGuardError(f"the guard of {self._topic} did not start within {_READY_TIMEOUT:.0f} s")
        for pipe in (process.stdin, process.stdout):  # a guard that hangs must not block the control
            os.set_blocking(pipe.fileno(), False)
        self._unanswered: float | None = None  # s, time of the first heartbeat without answer
        return process

    def _replace_apart(self, former: subprocess.Popen | None) -> None:
        self._replacing = threading.Thread(target=self._replace, args=[former], name="joint_guard", daemon=True)
        self._replacing.start()

    def _replace(self, former: subprocess.Popen | None) -> None:
        if former is not None:
            former.wait()
        if self._closed:
            return
        with contextlib.suppress(JointGuardError, OSError):
            process = self._start()
            if self._closed:
                self._write(process, GOODBYE)
            else:
                self._process = process

    @staticmethod
    def _answered(process: subprocess.Popen) -> bool:
        assert process.stdout is not None
        return bool(process.stdout.read(4096))  # None: nothing has come; empty: it has ended, which the next write finds

    @staticmethod
    def _write(process: subprocess.Popen, data: bytes) -> bool:
        """Write to the guard; return False when it has ended, and True when its pipe is full: it has beats to read then."""
        assert process.stdin is not None
        try:
            process.stdin.write(data)
        except OSError:
            return False
        return True
