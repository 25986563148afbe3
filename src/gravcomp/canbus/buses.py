"""Several CAN buses as one link: frames carry the name of their bus in `channel`.

Receiving waits for all buses at once. A bus that is lost is reopened in a thread of its own, because an adapter may take seconds,
while the others go on.
"""

import select
import threading
import time
from collections.abc import Callable, Iterable, Sequence

import can

from gravcomp.canbus.bus import BusError
from gravcomp.canbus.link import CanLink, LinkCounters
from gravcomp.description.hardware import CanBus

_REOPEN_PERIOD = 0.02  # s, between two looks whether the link's own back-off is over
_POLL = 1e-3  # s, for buses without a file descriptor to wait for


class CanBuses:
    """The buses `settings`, filtered for `frame_ids`. It has the methods of a CanLink, and names the bus that fails.

    Frames without a channel go to the bus `default` (its name).
    """

    def __init__(
        self,
        settings: Sequence[CanBus],
        default: str,
        frame_ids: list[int] | None = None,
        link: Callable[[CanBus, list[int] | None], CanLink] = CanLink,
    ):
        self.links = {bus.name: link(bus, frame_ids) for bus in settings}
        self._default = default
        self._reopening: dict[str, threading.Thread] = {}
        self._closed = threading.Event()

    @property
    def is_open(self) -> bool:
        """Whether any bus is open."""
        return any(link.is_open for link in self.links.values())

    @property
    def lost(self) -> dict[str, str]:
        """What is wrong, by the name of each bus that is not open."""
        return {name: link.status for name, link in self.links.items() if not link.is_open}

    @property
    def status(self) -> str:
        """State of the buses in one sentence."""
        if len(self.links) == 1:
            return next(iter(self.links.values())).status
        return "; ".join(f"{name}: {link.status}" for name, link in self.links.items())

    @property
    def counters(self) -> LinkCounters:
        """Sum of the counters of all buses."""
        total = LinkCounters()
        for link in self.links.values():
            for name, value in vars(link.counters).items():
                setattr(total, name, getattr(total, name) + value)
        return total

    def open(self) -> None:
        """Open every bus. Raises BusError, which names the bus, when one cannot be opened; the others are closed again."""
        self._closed.clear()
        opened: list[CanLink] = []
        for name, link in self.links.items():
            try:
                link.open()
            except BusError as error:
                for other in opened:
                    other.close()
                raise BusError(f"bus '{name}': {error}" if name else str(error)) from error
            opened.append(link)

    def receive(self, timeout: float) -> list[can.Message]:
        """Return all waiting frames of all buses, or wait for the first one up to `timeout` (s)."""
        if len(self.links) == 1:
            return next(iter(self.links.values())).receive(timeout)
        deadline = time.monotonic() + timeout
        while True:
            frames = self._waiting()
            remaining = deadline - time.monotonic()
            if frames or remaining <= 0.0:
                return frames
            self._wait(remaining)

    def send(self, frames: Iterable[can.Message]) -> bool:
        """Send the frames, each on the bus of its channel. Return False when one was not accepted."""
        if len(self.links) == 1:
            return next(iter(self.links.values())).send(frames)
        by_bus: dict[str, list[can.Message]] = {}
        for frame in frames:
            name = frame.channel if frame.channel in self.links else self._default
            by_bus.setdefault(str(name), []).append(frame)
        accepted = {name: self.links[name].is_open and self.links[name].send(own) for name, own in by_bus.items()}
        return all(accepted.values())

    def close(self) -> None:
        """Close all buses."""
        self._closed.set()
        for link in self.links.values():
            link.close()

    def _waiting(self) -> list[can.Message]:
        frames = []
        for name, link in self.links.items():
            if not link.is_open:
                self._reopen(name)
                continue
            for frame in link.receive(0.0):
                frame.channel = name
                frames.append(frame)
        return frames

    def _reopen(self, name: str) -> None:
        """Begin to reopen the bus, unless that is under way."""
        if name in self._reopening and self._reopening[name].is_alive():
            return

        def attempt() -> None:
            while not self.links[name].is_open and not self._closed.wait(_REOPEN_PERIOD):
                self.links[name].ensure_open()

        self._reopening[name] = threading.Thread(target=attempt, name=f"reopen {name}", daemon=True)
        self._reopening[name].start()

    def _wait(self, timeout: float) -> None:
        """Wait until any bus has a frame, at most `timeout` s."""
        descriptors = [link.fileno for link in self.links.values()]
        waitable = [number for number in descriptors if number is not None]
        step = timeout if len(waitable) == len(descriptors) else min(timeout, _POLL)
        try:
            select.select(waitable, [], [], step)
        except (OSError, ValueError):  # a bus was closed meanwhile
            time.sleep(min(timeout, _POLL))
