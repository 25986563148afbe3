"""The bridge's end of the connection to the guard process of joint_bridge, which it starts."""

import contextlib
import os
import select
import subprocess
import sys

from gravcomp.motors.joint_guard import BEAT, GOODBYE

_READY_TIMEOUT = 20.0  # s


class JointGuardError(RuntimeError):
    """There is no guard; the text says why."""


class JointGuardClient:
    """A guard process for the controller of efforts on `topic`. Raises JointGuardError when it does not start."""

    def __init__(self, topic: str, number: int, namespace: str):
        self._process = subprocess.Popen(
            [sys.executable, "-m", "gravcomp_hw.joint_guard", topic, str(number), namespace],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,  # it outlives the bridge's group
        )
        assert self._process.stdin is not None and self._process.stdout is not None
        ready = select.select([self._process.stdout], [], [], _READY_TIMEOUT)[0]
        if not ready or self._process.stdout.readline().strip() != b"ready":
            self._process.kill()
            raise JointGuardError(f"the guard of {topic} did not start within {_READY_TIMEOUT:.0f} s")
        os.set_blocking(self._process.stdin.fileno(), False)  # a guard that hangs must not block the control

    def beat(self) -> bool:
        """Send a heartbeat; return whether the guard runs. One that hangs counts as gone when its pipe is full."""
        return self._write(BEAT)

    def close(self) -> None:
        """Let the guard end: the bridge has sent its zeros itself."""
        self._write(GOODBYE)
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(2.0)

    def _write(self, data: bytes) -> bool:
        try:
            assert self._process.stdin is not None
            self._process.stdin.write(data)
            self._process.stdin.flush()
        except (OSError, ValueError):
            return False
        return True
