"""A CAN bus that is reopened after errors: it receives and sends without raising, counts errors, and reopens with back-off.

The adapter may be unplugged, the controller may go bus-off, the transmit queue may overflow. None of these ends the caller's
loop: `receive` and `send` report them by their results, and `status` says in one sentence what is wrong.
"""

import contextlib
import dataclasses
import threading
import time
from collections.abc import Callable, Iterable

import can

from gravcomp.canbus.bus import BusError, open_bus
from gravcomp.description.hardware import CanInterface

_FIRST_WAIT, _LONGEST_WAIT = 0.1, 2.0  # s, between attempts to reopen
_OVERLOAD_TIME = 0.5  # s of failing sends after which the bus is reopened
_MOST_AT_ONCE = 1024  # frames: 0.3 s of full traffic
_ERROR_BUS_OFF = 0x40  # socketcan error class
_WALL_CLOCK = 60.0  # s; an older stamp of a frame is not wall time


@dataclasses.dataclass
class LinkCounters:
    """Counters since the link was made."""

    received: int = 0
    sent: int = 0
    send_errors: int = 0
    error_frames: int = 0
    lost: int = 0  # how often an open bus was lost
    opened: int = 0


def lateness(frame: can.Message, wall: float) -> float:
    """Return the time (s) from when the kernel received the frame until `wall` (s, time.time()); 0 if its stamp is not wall time.

    With it, a delayed thread can date a frame correctly.
    """
    late = wall - frame.timestamp
    return late if 0.0 <= late < _WALL_CLOCK else 0.0


class CanLink:
    """The bus `settings`, filtered for `frame_ids`; it is reopened when it is lost.

    It is opened by the first `open`, `receive` or `send`. One thread receives; any thread may send.
    `opener` opens the bus and raises BusError; `clock` returns s. Both can be replaced for tests.
    Attributes: counters, status.
    """

    def __init__(
        self,
        settings: CanInterface,
        frame_ids: list[int] | None = None,
        *,
        opener: Callable[[CanInterface, list[int] | None], can.BusABC] = open_bus,
        clock: Callable[[], float] = time.monotonic,
    ):
        self.counters = LinkCounters()
        self.status = "not opened"
        self._settings, self._frame_ids, self._opener, self._clock = settings, frame_ids, opener, clock
        self._bus: can.BusABC | None = None
        self._wait, self._next_attempt = _FIRST_WAIT, -float("inf")
        self._failing_since: float | None = None
        self._lock = threading.RLock()

    @property
    def is_open(self) -> bool:
        """Whether the bus is open."""
        return self._bus is not None

    @property
    def fileno(self) -> int | None:
        """File descriptor that becomes readable with the next frame; None where the interface has none, or without a bus."""
        bus = self._bus
        try:
            number = -1 if bus is None else bus.fileno()
        except (NotImplementedError, OSError, ValueError):
            return None
        return number if number >= 0 else None

    def open(self) -> None:
        """Open the bus if it is not open. Raises BusError."""
        with self._lock:
            if self._bus is None:
                self._bus = self._opener(self._settings, self._frame_ids)
                self._failing_since, self.status = None, "open"
                self.counters.opened += 1

    def ensure_open(self) -> bool:
        """Open the bus if it is not open and its back-off is over. Return whether it is open."""
        if self._bus is not None:
            return True
        with self._lock:
            if self._clock() < self._next_attempt:
                return False
            try:
                self.open()
            except BusError as error:
                self.status = str(error)
                self._schedule()
                return False
            return True

    def receive(self, timeout: float) -> list[can.Message]:
        """Return all waiting frames, or wait for the first one up to `timeout` (s); empty when none comes or there is no bus.

        Without a bus it sleeps for the time-out, so that the caller's loop keeps its pace.
        """
        deadline = self._clock() + timeout
        frames: list[can.Message] = []
        if not self.ensure_open():
            time.sleep(max(0.0, min(timeout, _FIRST_WAIT)))
            return frames
        bus = self._bus
        try:
            while bus is not None and len(frames) < _MOST_AT_ONCE:
                frame = bus.recv(0.0 if frames else max(0.0, deadline - self._clock()))
                if frame is None:
                    break
                self.counters.received += 1
                self._wait = _FIRST_WAIT
                if frame.is_error_frame:
                    self.counters.error_frames += 1
                    if frame.arbitration_id & _ERROR_BUS_OFF:
                        self._lose("bus-off: is the bus terminated, and does any other node acknowledge?")
                        break
                    continue
                frames.append(frame)
        except Exception as error:  # drivers raise different exceptions when their adapter is unplugged
            self._lose(str(error) or type(error).__name__)
        return frames

    def send(self, frames: Iterable[can.Message]) -> bool:
        """Send the frames in order. Return False when one was not accepted (no bus, full queue, adapter unplugged)."""
        if not self.ensure_open():
            return False
        with self._lock:
            try:
                for frame in frames:
                    if self._bus is None:
                        return False
                    self._bus.send(frame)
                    self.counters.sent += 1
                self._failing_since = None
                return True
            except Exception as error:
                self.counters.send_errors += 1
                now = self._clock()
                self._failing_since = now if self._failing_since is None else self._failing_since
                self.status = f"cannot send: {error}"
                if now - self._failing_since > _OVERLOAD_TIME:
                    self._lose(self.status)
                return False

    def close(self) -> None:
        """Close the bus; it is not reopened by `receive` or `send`."""
        with self._lock:
            bus, self._bus = self._bus, None
            self._next_attempt = float("inf")
            self.status = "closed"
        _shut(bus)

    def _lose(self, why: str) -> None:
        with self._lock:
            bus, self._bus = self._bus, None
            if bus is None:
                return
            self.counters.lost += 1
            self.status = why
            self._schedule()
        _shut(bus)

    def _schedule(self) -> None:
        self._next_attempt = self._clock() + self._wait
        self._wait = min(2 * self._wait, _LONGEST_WAIT)


def _shut(bus: can.BusABC | None) -> None:
    if bus is not None:
        with contextlib.suppress(Exception):  # a bus without its adapter cannot always be shut down
            bus.shutdown()
