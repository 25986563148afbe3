"""Latency from an IMU sample to the motor current, measured on the bus.

Directly after the current frame that a new command caused, the bridge sends a CommandTrace frame with the board time of the
command's IMU sample. The latency is the time between the last frame of the sample and that current frame, both as stamped by the
kernel of the listener.
"""

import contextlib
import threading
import time

import can

from gravcomp.canbus import c610, codec
from gravcomp.canbus.bus import BusError, open_bus
from gravcomp.canbus.link import CanLink
from gravcomp.description.hardware import CanInterface

# Listening takes part of a core at full bus load, so it is done in short intervals.
_LOOK, _PAUSE = 1.0, 3.0  # s, of an interval and between two


class DelayListener:
    """A thread that listens at intervals and adds to `delays` (s); `failure` names a bus that cannot be opened."""

    def __init__(self, settings: CanInterface):
        self.delays: list[float] = []
        self.failure: str | None = None
        self._settings = settings
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run, name="bus delay", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def stop(self) -> None:
        """Stop the thread."""
        self._end.set()
        self._thread.join(_LOOK + 1.0)

    def _run(self) -> None:
        while not self._end.wait(_PAUSE):
            try:
                bus = open_bus(self._settings, _frame_ids())
            except BusError as error:
                self.failure = str(error)
                return
            with bus:
                frames: list[can.Message] = []
                while not self._end.is_set() and (not frames or frames[-1].timestamp - frames[0].timestamp < _LOOK):
                    frame = bus.recv(0.2)
                    if frame is None:
                        break
                    frames.append(frame)
            self.delays += delays_of(frames)


def delays_during(settings: CanInterface, duration: float) -> list[float]:
    """Listen to a bus for `duration` (s) and return the latencies (s). Raises BusError when it cannot be opened."""
    frames: list[can.Message] = []
    with contextlib.closing(CanLink(settings, _frame_ids())) as link:
        link.open()
        end = time.monotonic() + duration
        while time.monotonic() < end:
            frames += link.receive(0.05)
    return delays_of(frames)


def delays_of(frames: list[can.Message]) -> list[float]:
    """Return the latency (s) from each IMU sample with a CommandTrace to the first current frame that it caused."""
    imu_time, trace = codec.layout("ImuTime").frame_id, codec.layout("CommandTrace").frame_id
    sampled: dict[float, float] = {}
    last_current: float | None = None
    delays = []
    for frame in frames:
        if frame.arbitration_id in c610.COMMAND_IDS:
            last_current = frame.timestamp
            continue
        try:
            values = codec.decode(frame).values
        except codec.FrameError:
            continue
        if frame.arbitration_id == imu_time:
            sampled[values.time] = frame.timestamp
        elif frame.arbitration_id == trace and last_current is not None:
            begin = sampled.pop(values.time, None)
            if begin is not None and last_current >= begin:
                delays.append(last_current - begin)
    return delays


def _frame_ids() -> list[int]:
    """Return the ids of the frames from which latencies follow."""
    return [codec.layout("ImuTime").frame_id, codec.layout("CommandTrace").frame_id, *c610.COMMAND_IDS]
