"""The guard: a process beside the bridge that zeroes the motor currents when the bridge dies or hangs.

A C610 holds the last current it was told, so somebody must send zeros when the bridge cannot. The bridge keeps a local
connection to the guard and beats over it. The connection ends with the bridge, however it ended, and a bridge that hangs
stops beating: in both cases the guard sends zeros every PERIOD. It answers every beat, so that the bridge replaces a guard that
hangs. It also

- admits one bridge a bus: a second one is refused,
- counts the rotors' turns while no bridge does, so that a bridge that comes back knows its zeros,
- ends with the bridge's clean end, and LINGER after its death if none comes back.

    guard = GuardClient.connect(can_interface, hardware)      # starts the process if there is none
    guard.record                                              # ZeroRecord of an earlier run, or None
    guard.beat(record); guard.close()
"""

import argparse
import contextlib
import dataclasses
import hashlib
import json
import os
import select
import signal
import socket
import struct
import subprocess
import sys
import time

from gravcomp.canbus import codec
from gravcomp.canbus.link import CanLink, lateness
from gravcomp.canbus.precedence import take_precedence
from gravcomp.description.hardware import CanInterface, Hardware
from gravcomp.motors.encoder import Encoder
from gravcomp.motors.output import CurrentOutput
from gravcomp.motors.state import RotorRecord, ZeroRecord

PERIOD = 0.01
"""s between zeros."""

BEAT_TIMEOUT = 0.1
"""s without a beat after which the bridge counts as hung."""

ANSWER_TIMEOUT = 1.0
"""s without an answer to a beat after which the guard counts as hung."""

LINGER = 15.0
"""s for which the guard waits for the next bridge after a death."""

_START_TIMEOUT = 10.0  # s for the process to answer
_SHARED_INTERFACES = ("socketcan", "udp_multicast", "virtual")  # that two processes may have open at once


class GuardError(Exception):
    """There is no guard for this bus, or another bridge has it; the text is for people."""


@dataclasses.dataclass(frozen=True)
class GuardSettings:
    """What the process is told: the bus, the motors, and after what silence (s) their turns are lost."""

    can: dict
    can_ids: list[int]
    zero_timeout: float

    @property
    def address(self) -> str:
        """Name of the local socket: one a bus."""
        name = json.dumps([self.can["interface"], self.can["channel"]])
        return "\0gravcomp-guard-" + hashlib.sha1(name.encode()).hexdigest()[:20]


class GuardClient:
    """The bridge's end of the connection. Attributes: record (ZeroRecord | None) of an earlier run."""

    def __init__(self, connection: socket.socket, record: ZeroRecord | None):
        self.record = record
        self._connection = connection
        self._unanswered: float | None = None  # s, since when

    @classmethod
    def connect(cls, can: CanInterface, hardware: Hardware, record: ZeroRecord | None = None) -> "GuardClient":
        """Connect to the bus's guard, started if there is none; `record` is what the bridge knows itself. Raises GuardError."""
        settings = GuardSettings(
            dataclasses.asdict(can), [motor.can_id for motor in hardware.motors], hardware.watchdog.zero_timeout
        )
        deadline, process = time.monotonic() + _START_TIMEOUT, None
        while True:
            connection = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            try:
                connection.settimeout(2 * ANSWER_TIMEOUT)
                connection.connect(settings.address)
                connection.send(json.dumps({"hello": os.getpid(), "beat": record and _content_of(record)}).encode())
                answer = json.loads(connection.recv(65536) or b"{}")
                if "busy" in answer:
                    raise GuardError(f"another bridge (process {answer['busy']}) already drives {can.interface} {can.channel}")
                if "record" in answer:
                    connection.setblocking(False)
                    return cls(connection, _record_of(answer["record"]))
            except TimeoutError:
                _end_peer(connection)
            except (OSError, ValueError):
                pass  # none there yet, or one that is just ending
            except GuardError:
                connection.close()
                raise
            connection.close()
            if process is None or process.poll() is not None:
                process = _start_process(settings)
            if time.monotonic() > deadline:
                raise GuardError(f"the guard process of {can.interface} {can.channel} does not answer")
            time.sleep(0.02)

    def beat(self, record: ZeroRecord | None) -> bool:
        """Tell the guard that the bridge lives. False when the guard is gone; one that hangs is ended first."""
        try:
            self._hear_answers()
            if self._unanswered is not None and time.monotonic() - self._unanswered > ANSWER_TIMEOUT:
                _end_peer(self._connection)
                self._connection.close()
                return False
            self._connection.send(json.dumps({"beat": record and _content_of(record)}).encode())
        except BlockingIOError:
            pass  # it has not read the last ones yet
        except OSError:
            return False
        if self._unanswered is None:
            self._unanswered = time.monotonic()
        return True

    def _hear_answers(self) -> None:
        """Raises OSError when the guard is gone."""
        while True:
            try:
                if not self._connection.recv(64):
                    raise ConnectionResetError("the guard has ended")
            except BlockingIOError:
                return
            self._unanswered = None

    def close(self) -> None:
        """A clean end: the currents are zero already."""
        try:
            self._connection.send(b'{"bye": true}')
        except OSError:
            pass
        self._connection.close()


class Guard:
    """The process's loop, see the module."""

    def __init__(self, settings: GuardSettings):
        self._settings = settings
        self._can = CanInterface(**settings.can)
        self._output = CurrentOutput(settings.can_ids, 0.0)
        self._listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._listener.bind(settings.address)
        self._listener.listen(4)
        self._owner: socket.socket | None = None
        self._owner_pid = 0
        self._last_beat = 0.0
        self._record: ZeroRecord | None = None
        self._counting: dict[int, Encoder] = {}
        self._sender = CanLink(self._can, frame_ids=[0x7FF])  # it sends only
        self._receiver: CanLink | None = None
        self._ending = False
        self._deadline = time.monotonic() + LINGER

    def run(self) -> None:
        """Until nobody needs it any more."""
        for number in (signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, lambda *_: setattr(self, "_ending", True))
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the bridge; the guard outlives it
        if self._can.interface in _SHARED_INTERFACES:
            self._sender.receive(0.0)  # opens it ahead of need
        while not self._ending and (self._owner or time.monotonic() < self._deadline):
            sockets = [self._listener] + ([self._owner] if self._owner else [])
            for ready in select.select(sockets, [], [], PERIOD)[0]:
                if ready is self._listener:
                    self._admit(ready.accept()[0])
                elif ready is self._owner:
                    self._hear()
            now = time.monotonic()
            if self._owner is None or now - self._last_beat > BEAT_TIMEOUT:
                self._sender.send(self._output.zero())
            if self._receiver is not None:
                self._count(now)
        self._listener.close()  # first: who comes now shall start a new guard
        self._sender.send(self._output.zero())
        self._sender.close()

    def _admit(self, connection: socket.socket) -> None:
        connection.settimeout(1.0)
        try:
            hello = json.loads(connection.recv(65536))
            while self._owner is not None and select.select([self._owner], [], [], 0.0)[0]:
                self._hear()  # it may have ended just before the new one came
            if self._ending:
                connection.close()  # the new one starts another guard
                return
            if self._owner is not None:
                connection.send(json.dumps({"busy": self._owner_pid}).encode())
                connection.close()
                return
            pid, record = int(hello["hello"]), _record_of(hello["beat"]) or self._current_record()
            connection.setblocking(False)
            self._owner, self._owner_pid = connection, pid
            self._last_beat, self._record = time.monotonic(), record
            self._stop_counting()
            with contextlib.suppress(OSError):  # it may be dead again; then its connection ends, as any other's
                connection.send(json.dumps({"record": record and _content_of(record)}).encode())
        except (OSError, ValueError, KeyError, TypeError):
            connection.close()

    def _hear(self) -> None:
        try:
            message = self._owner.recv(65536)
            content = json.loads(message) if message else None
        except BlockingIOError:
            return
        except (OSError, ValueError):
            content = None
        if content is not None and "beat" in content:
            self._last_beat = time.monotonic()
            self._record = _record_of(content["beat"])
            with contextlib.suppress(OSError):  # a bridge that hangs does not read
                self._owner.send(b"{}")
            return
        self._owner.close()
        self._owner = None
        self._sender.send(self._output.zero())
        if content is not None:
            self._ending = True
            return
        self._deadline = time.monotonic() + LINGER
        self._start_counting()

    def _start_counting(self) -> None:
        if self._record is None:
            return
        for can_id, rotor in self._record.items():
            self._counting[can_id] = Encoder()
            self._counting[can_id].restore(rotor.count, rotor.speed, rotor.time, rotor.certain)
        self._receiver = CanLink(self._can, [0x200 + can_id for can_id in self._counting])

    def _stop_counting(self) -> None:
        if self._receiver is not None:
            self._receiver.close()
        self._receiver, self._counting = None, {}

    def _count(self, now: float) -> None:
        wall = time.time()
        for frame in self._receiver.receive(0.0):
            try:
                feedback = codec.decode(frame).values
            except codec.FrameError:
                continue
            encoder = self._counting.get(frame.arbitration_id - 0x200)
            if encoder is not None:
                encoder.update(feedback.angle, feedback.speed, feedback.current, now - lateness(frame, wall))
        if any(now - encoder.time > self._settings.zero_timeout for encoder in self._counting.values()):
            self._record = None
            self._stop_counting()

    def _current_record(self) -> ZeroRecord | None:
        if self._record is None:
            return None
        return {
            can_id: RotorRecord(encoder.count, self._record[can_id].zero, encoder.speed, encoder.time, encoder.certain)
            for can_id, encoder in self._counting.items()
        }


def main() -> int:
    """`python -m gravcomp.motors.guard SETTINGS` with the settings as JSON."""
    parser = argparse.ArgumentParser(description="Zeroes the motor currents when the bridge dies. Started by the bridge.")
    parser.add_argument("settings", help="GuardSettings as JSON")
    settings = GuardSettings(**json.loads(parser.parse_args().settings))
    try:
        guard = Guard(settings)
    except OSError:
        return 0  # another guard was faster
    take_precedence()
    guard.run()
    return 0


def _start_process(settings: GuardSettings) -> subprocess.Popen:
    """In a session of its own, so that what ends the bridge's process group does not end the guard."""
    command = [sys.executable, "-m", "gravcomp.motors.guard", json.dumps(dataclasses.asdict(settings))]
    return subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )


def _end_peer(connection: socket.socket) -> None:
    """Kill the process at the other end, a guard that hangs: its address is free for another one then."""
    pid = struct.unpack("3i", connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, struct.calcsize("3i")))[0]
    if pid > 0:  # 0 means that it was not connected yet
        with contextlib.suppress(OSError):
            os.kill(pid, signal.SIGKILL)


def _content_of(record: ZeroRecord) -> dict[int, tuple]:
    return {can_id: dataclasses.astuple(rotor) for can_id, rotor in record.items()}


def _record_of(content: dict | None) -> ZeroRecord | None:
    return {int(can_id): RotorRecord(*rotor) for can_id, rotor in content.items()} if content else None


if __name__ == "__main__":
    raise SystemExit(main())
