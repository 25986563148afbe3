"""The virtual robot at the pace of the clock, on a real CAN bus.

A thread of its own: every period it takes what has arrived, steps the robot, sends what the robot sent. After a pause of the
machine it catches up, not faster than a wire of 1 Mbit/s carries the frames; what is later than `_LONGEST_LAG` is given up,
and virtual time then lags behind the clock (counted in `lost_time`).
"""

import contextlib
import copy
import os
import threading
import time
from collections.abc import Callable

from gravcomp.canbus.codec import layout
from gravcomp.canbus.link import CanLink
from gravcomp.description.hardware import CanInterface
from gravcomp.virtual.robot import Truth, VirtualRobot

_PERIOD = 0.002  # s
_FRAME_TIME = 0.11e-3  # s on a wire of 1 Mbit/s
_BURST = 0.02  # s of frames at once after a pause; receivers' socket buffers hold about 30 ms
_LONGEST_LAG = 0.1  # s
_NICENESS = -10

RECEIVED_FRAMES = ("MotorCommand1to4", "MotorCommand5to8", "HeaterCommand")


class RealtimeRobot:
    """Runs `robot` on the bus `settings`; `on_truth` is called from the thread `truth_rate` times a second.

    Whoever touches the robot from outside holds `lock`.
    """

    def __init__(self, robot: VirtualRobot, settings: CanInterface, on_truth: Callable[[Truth], None], truth_rate: float):
        self.robot, self.lock = robot, threading.Lock()
        self.link = CanLink(settings, [layout(name).frame_id for name in RECEIVED_FRAMES])
        self.lost_time = 0.0
        self.error: BaseException | None = None
        self._on_truth, self._truth_period = on_truth, max(1, round(1.0 / truth_rate / _PERIOD))
        # A copy takes the first step, so that compiling is over before the bus is open.
        copy.deepcopy(robot).step(0.02)
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Open the bus and start. Raises BusError."""
        self.link.open()
        self._stop.clear()
        self._thread = threading.Thread(target=self._run, name="virtual_robot", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Stop and close the bus; nothing is sent afterwards."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        self.link.close()

    def _run(self) -> None:
        # Hardware does not wait for other processes; where the user may not ask for it, the thread takes its turn.
        with contextlib.suppress(OSError):
            os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), _NICENESS)
        try:
            self._loop()
        except Exception as error:  # the node reports it; a thread that dies silently would look like a dead bus
            self.error = error

    def _loop(self) -> None:
        deadline = wire_free = time.monotonic()
        count = 0
        while not self._stop.is_set():
            now = time.monotonic()
            deadline += _PERIOD
            if now - deadline > _LONGEST_LAG:
                self.lost_time += now - deadline
                deadline = now
            frames, until = [], max(deadline, wire_free)
            while (remaining := until - time.monotonic()) > 0.0:
                frames += self.link.receive(remaining)
            if not frames:
                frames = self.link.receive(0.0)
            with self.lock:
                sent = self.robot.step(_PERIOD, frames)
                count += 1
                truth = self.robot.truth if count % self._truth_period == 0 else None
            if sent:
                self.link.send(sent)
                wire_free = max(wire_free, time.monotonic() - _BURST) + len(sent) * _FRAME_TIME
            if truth is not None:
                self._on_truth(truth)
