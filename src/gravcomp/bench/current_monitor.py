"""Observation of the CAN bus: motor currents, followed commands and IMU samples."""

import threading
import time

from gravcomp.canbus import codec
from gravcomp.canbus.c610 import COMMAND_IDS
from gravcomp.canbus.link import CanLink
from gravcomp.launcher.virtual_graph import RunningGraph


class CurrentMonitor:
    """A thread that reads every frame with motor currents that another process sends.

    Attributes: frames (their number), violations (frames with a current beyond `limit`, A), largest (A), traces (CommandTrace
    frames), last_sample (s, host: the last complete frame of the IMU).
    """

    def __init__(self, graph: RunningGraph, limit: float) -> None:
        self.frames = self.violations = self.traces = 0
        self.largest = self.last_sample = 0.0
        self._trace_id, self._imu_id = (codec.layout(name).frame_id for name in ("CommandTrace", "ImuTime"))
        self.link = CanLink(graph.can, [*COMMAND_IDS, self._trace_id, self._imu_id])
        self._limit = limit
        self._zero = dict.fromkeys(COMMAND_IDS, True)
        self._changes: list[tuple[float, bool]] = []  # host time from which on all currents are zero, or are not
        self._last_trace = 0.0
        self._ending = threading.Event()
        self.link.open()
        self._thread = threading.Thread(target=self._watch, name="monitor", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop the thread and leave the bus."""
        self._ending.set()
        self._thread.join(2.0)
        self.link.close()

    def zero_since(self, since: float, timeout: float, lasting: float = 0.05) -> float | None:
        """Wait until all currents have been zero for `lasting` (s).

        Return the host time from which on they are zero, at least `since`; None after `timeout` (s).
        """
        end = time.monotonic() + timeout
        while time.monotonic() < end:
            last = self._changes[-1] if self._changes else (0.0, True)
            if last[1] and time.time() - max(last[0], since) >= lasting:
                return max(last[0], since)
            time.sleep(0.005)
        return None

    def trace_after(self, since: float, timeout: float) -> float | None:
        """Wait for a CommandTrace after `since` (s, host), which shows a followed command.

        Return its host time; None after `timeout` (s).
        """
        end = time.monotonic() + timeout
        while time.monotonic() < end:
            if self._last_trace > since:
                return self._last_trace
            time.sleep(0.005)
        return None

    def _watch(self) -> None:
        while not self._ending.is_set():
            for frame in self.link.receive(0.05):
                try:
                    values = codec.decode(frame).values
                except codec.FrameError:
                    continue
                if frame.arbitration_id == self._imu_id:
                    self.last_sample = frame.timestamp
                    continue
                if frame.arbitration_id == self._trace_id:
                    self.traces += 1
                    self._last_trace = frame.timestamp
                    continue
                largest = max(map(abs, values))
                self.frames += 1
                self.largest = max(self.largest, largest)
                self.violations += largest > self._limit
                before = all(self._zero.values())
                self._zero[frame.arbitration_id] = largest == 0.0
                after = all(self._zero.values())
                if before != after:
                    self._changes.append((frame.timestamp, after))
