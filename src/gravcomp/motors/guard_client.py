"""The bridge's end of the connection to its guard process, which it starts when there is none.

guard = GuardClient.connect(hardware)
guard.record                          # ZeroRecord of an earlier run, or None
guard.beat(record)                    # every 10 ms
guard.close()                         # after zero current
"""

import contextlib
import dataclasses
import json
import os
import signal
import socket
import struct
import subprocess
import sys
import time

from gravcomp.description.hardware import Hardware
from gravcomp.motors.guard_protocol import ANSWER_TIMEOUT, LONGEST_MESSAGE, GuardSettings, decoded, encoded, new_socket
from gravcomp.motors.state import ZeroRecord

_START_TIMEOUT = 10.0  # s for the process to answer
_RETRY_PERIOD = 0.02  # s


class GuardError(Exception):
    """The bus has no guard, or another bridge drives it. The text is shown to the user."""


class GuardClient:
    """A connection to the guard of one bus. Attribute: record, of an earlier run, by CAN id, or None."""

    def __init__(self, connection: socket.socket, record: ZeroRecord | None):
        self.record = record
        self._connection = connection
        self._unanswered: float | None = None  # s, time of the first heartbeat without answer

    @classmethod
    def connect(cls, hardware: Hardware, record: ZeroRecord | None = None, bus: int = 0) -> "GuardClient":
        """Connect to the guard of the bus with this index in `hardware.all_buses`, and start it when there is none.

        `record`, by CAN id, is what the bridge has itself. Raises GuardError when another bridge drives this bus or no guard
        answers.
        """
        settings, can = GuardSettings.of(hardware, bus), hardware.all_buses[bus]
        deadline, process = time.monotonic() + _START_TIMEOUT, None
        while True:
            connection = new_socket()
            try:
                connection.settimeout(2 * ANSWER_TIMEOUT)
                connection.connect(settings.address)
                connection.send(json.dumps({"hello": os.getpid(), "beat": encoded(record)}).encode())
                answer = json.loads(connection.recv(LONGEST_MESSAGE) or b"{}")
                if "busy" in answer:
                    raise GuardError(f"another bridge (process {answer['busy']}) already drives {can.label}")
                if "record" in answer:
                    connection.setblocking(False)
                    return cls(connection, decoded(answer["record"]))
            except TimeoutError:
                _kill_peer(connection)
            except (OSError, ValueError):
                pass  # no guard yet, or one that is just ending
            except GuardError:
                connection.close()
                raise
            connection.close()
            if process is None or process.poll() is not None:
                process = _start_process(settings)
            if time.monotonic() > deadline:
                raise GuardError(f"the guard process of {can.label} does not answer")
            time.sleep(_RETRY_PERIOD)

    def beat(self, record: ZeroRecord | None) -> bool:
        """Send a heartbeat. Return False when the guard is gone; a guard that hangs is killed first."""
        try:
            self._read_answers()
            if self._unanswered is not None and time.monotonic() - self._unanswered > ANSWER_TIMEOUT:
                _kill_peer(self._connection)
                self._connection.close()
                return False
            self._connection.send(json.dumps({"beat": encoded(record)}).encode())
        except BlockingIOError:
            pass  # the guard has not read the last heartbeats yet
        except OSError:
            return False
        if self._unanswered is None:
            self._unanswered = time.monotonic()
        return True

    def close(self) -> None:
        """End the connection cleanly, which ends the guard. The currents must be zero.

        The guard closes its end first: closed here with answers that are not read, the connection would be reset, and the guard
        would take that for the death of the bridge before it reads the good-bye.
        """
        with contextlib.suppress(OSError):
            self._connection.settimeout(ANSWER_TIMEOUT)
            self._connection.send(b'{"bye": true}')
            while self._connection.recv(64):
                pass
        self._connection.close()

    def _read_answers(self) -> None:
        """Read all waiting answers. Raises OSError when the guard is gone."""
        while True:
            try:
                if not self._connection.recv(64):
                    raise ConnectionResetError("the guard has ended")
            except BlockingIOError:
                return
            self._unanswered = None


def _start_process(settings: GuardSettings) -> subprocess.Popen:
    """Start the guard in its own session, so that a signal to the bridge's process group does not end it."""
    command = [sys.executable, "-m", "gravcomp.motors.guard", json.dumps(dataclasses.asdict(settings))]
    return subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )


def _kill_peer(connection: socket.socket) -> None:
    """Kill the process at the other end, a guard that hangs; its address is free for another one then."""
    pid = struct.unpack("3i", connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, struct.calcsize("3i")))[0]
    if pid > 0:  # 0: not connected yet
        with contextlib.suppress(OSError):
            os.kill(pid, signal.SIGKILL)
