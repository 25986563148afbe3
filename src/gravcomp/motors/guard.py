"""The guard: a process that zeroes the motor currents when the bridge dies or hangs.

A C610 holds the last current that it received, so another process must send zeros when the bridge cannot. The bridge keeps a
local connection to the guard and sends heartbeats over it. The connection ends when the bridge dies, and a bridge that hangs
stops sending heartbeats; in both cases the guard sends zeros every PERIOD. The guard answers every heartbeat, so that the bridge
can replace a guard that hangs. It also

- admits one bridge per bus and refuses a second one,
- counts the rotors' turns while no bridge does, so that the next bridge knows the zero positions,
- ends after a clean end of the bridge, and LINGER after its death if no other bridge comes.

    python -m gravcomp.motors.guard SETTINGS      # GuardSettings as JSON; started by GuardClient
"""

import argparse
import contextlib
import json
import select
import signal
import socket
import time

from gravcomp.canbus import c610, codec
from gravcomp.canbus.link import CanLink, lateness
from gravcomp.canbus.precedence import take_precedence
from gravcomp.description.hardware import CanInterface
from gravcomp.motors.encoder import Encoder
from gravcomp.motors.guard_protocol import BEAT_TIMEOUT, LONGEST_MESSAGE, GuardSettings, decoded, encoded, new_socket
from gravcomp.motors.output import CurrentOutput
from gravcomp.motors.state import ZeroRecord

PERIOD = 0.01
"""s between two frames of zeros."""

LINGER = 15.0
"""s for which the guard waits for the next bridge after a death."""

_HELLO_TIMEOUT = 1.0  # s for a new bridge to send its first message
_SHARED_INTERFACES = ("socketcan", "udp_multicast", "virtual")  # two processes may have these open at the same time
_NO_FRAMES = [0x7FF]  # an id that nobody uses: the sending link receives nothing


class Guard:
    """The guard's loop. Raises OSError when the bus already has a guard."""

    def __init__(self, settings: GuardSettings):
        self._settings = settings
        self._can = CanInterface(**settings.can)
        self._output = CurrentOutput(settings.can_ids, 0.0)
        self._listener = new_socket()
        self._listener.bind(settings.address)
        self._listener.listen(4)
        self._bridge: socket.socket | None = None
        self._bridge_pid = 0
        self._last_beat = 0.0
        self._record: ZeroRecord | None = None
        self._encoders: dict[int, Encoder] = {}  # while no bridge counts
        self._sender = CanLink(self._can, frame_ids=_NO_FRAMES)
        self._receiver: CanLink | None = None
        self._ending = False
        self._deadline = time.monotonic() + LINGER

    def run(self) -> None:
        """Serve bridges until the guard is no longer needed or is ended by a signal."""
        for number in (signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, lambda *_: setattr(self, "_ending", True))
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the bridge; the guard outlives it
        if self._can.interface in _SHARED_INTERFACES:
            self._sender.receive(0.0)  # opens the link before it is needed
        while not self._ending and (self._bridge or time.monotonic() < self._deadline):
            sockets = [self._listener] + ([self._bridge] if self._bridge else [])
            for ready in select.select(sockets, [], [], PERIOD)[0]:
                if ready is self._listener:
                    self._admit(ready.accept()[0])
                elif ready is self._bridge:
                    self._read(ready)
            now = time.monotonic()
            if self._bridge is None or now - self._last_beat > BEAT_TIMEOUT:
                self._sender.send(self._output.zero())
            if self._receiver is not None:
                self._count(self._receiver, now)
        self._listener.close()  # first, so that a bridge that comes now starts a new guard
        self._sender.send(self._output.zero())
        self._sender.close()

    def _admit(self, connection: socket.socket) -> None:
        connection.settimeout(_HELLO_TIMEOUT)
        try:
            hello = json.loads(connection.recv(LONGEST_MESSAGE))
            while self._bridge is not None and select.select([self._bridge], [], [], 0.0)[0]:
                self._read(self._bridge)  # the old bridge may have ended just before the new one came
            if self._ending:
                connection.close()  # the new bridge starts another guard
                return
            if self._bridge is not None:
                connection.send(json.dumps({"busy": self._bridge_pid}).encode())
                connection.close()
                return
            pid, record = int(hello["hello"]), decoded(hello["beat"]) or self._current_record()
            connection.setblocking(False)
            self._bridge, self._bridge_pid = connection, pid
            self._last_beat, self._record = time.monotonic(), record
            self._stop_counting()
            with contextlib.suppress(OSError):  # it may already be dead; then its connection ends like any other
                connection.send(json.dumps({"record": encoded(record)}).encode())
        except (OSError, ValueError, KeyError, TypeError):
            connection.close()

    def _read(self, bridge: socket.socket) -> None:
        """Read one message of the bridge, or the end of its connection."""
        try:
            message = bridge.recv(LONGEST_MESSAGE)
            content = json.loads(message) if message else None
        except BlockingIOError:
            return
        except (OSError, ValueError):
            content = None
        if content is not None and "beat" in content:
            self._last_beat = time.monotonic()
            self._record = decoded(content["beat"])
            with contextlib.suppress(OSError):  # a bridge that hangs does not read
                bridge.send(b"{}")
            return
        bridge.close()
        self._bridge = None
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
            self._encoders[can_id] = Encoder()
            self._encoders[can_id].restore(rotor)
        self._receiver = CanLink(self._can, [c610.feedback_id(can_id) for can_id in self._encoders])

    def _stop_counting(self) -> None:
        if self._receiver is not None:
            self._receiver.close()
        self._receiver, self._encoders = None, {}

    def _count(self, receiver: CanLink, now: float) -> None:
        wall = time.time()
        for frame in receiver.receive(0.0):
            try:
                feedback = codec.decode(frame).values
            except codec.FrameError:
                continue
            motor = c610.motor_of(frame.arbitration_id)
            encoder = None if motor is None else self._encoders.get(motor)
            if encoder is not None:
                encoder.update(feedback.angle, feedback.speed, feedback.current, now - lateness(frame, wall))
        if any(now - encoder.time > self._settings.zero_timeout for encoder in self._encoders.values()):
            self._record = None
            self._stop_counting()

    def _current_record(self) -> ZeroRecord | None:
        if self._record is None:
            return None
        rotors = {can_id: encoder.record(self._record[can_id].zero) for can_id, encoder in self._encoders.items()}
        return {can_id: rotor for can_id, rotor in rotors.items() if rotor is not None}


def main() -> int:
    """Run the guard with the settings (JSON) from the command line."""
    parser = argparse.ArgumentParser(description="Zeroes the motor currents when the bridge dies. The bridge starts it.")
    parser.add_argument("settings", help="GuardSettings as JSON")
    settings = GuardSettings(**json.loads(parser.parse_args().settings))
    try:
        guard = Guard(settings)
    except OSError:
        return 0  # another guard has the bus
    take_precedence()
    guard.run()
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
