"""The virtual robot at the pace of the clock, on a real CAN bus.

A thread of its own: every period it takes what has arrived, steps the robot, sends what the robot sent. After a pause of the
machine it catches up, not faster than a wire of 1 Mbit/s carries the frames; what is later than `_LONGEST_LAG` is skipped:
frames are lost then (counted in `lost_time`), but virtual time keeps to the clock, so that rates and stamps fit together.
"""

import copy
import threading
import time
from collections.abc import Callable

import numpy as np

from gravcomp.canbus.codec import layout
from gravcomp.canbus.link import CanLink
from gravcomp.canbus.precedence import take_precedence
from gravcomp.description.hardware import CanInterface
from gravcomp.virtual.robot import Truth, VirtualRobot

_SHORTEST_PERIOD, _LONGEST_PERIOD = 0.002, 0.004  # s, between two looks at the bus; as long as the motors' feedback in between
_FRAME_TIME = 0.11e-3  # s on a wire of 1 Mbit/s
_BURST = 0.02  # s of frames at once after a pause; receivers' socket buffers hold about 30 ms
_LONGEST_LAG = 0.1  # s
_STEER_PERIOD = 0.01  # s

RECEIVED_FRAMES = ("MotorCommand1to4", "MotorCommand5to8", "HeaterCommand")


class RealtimeRobot:
    """Runs `robot` on the bus `settings`; `on_truth` is called from the thread `truth_rate` times a second, and `steer` every 10 ms:
    where to turn the base from now on, (3, 3) world from soft_base, or None.

    Whoever touches the robot from outside holds `lock`.
    """

    def __init__(
        self,
        robot: VirtualRobot,
        settings: CanInterface,
        on_truth: Callable[[Truth], None],
        truth_rate: float,
        steer: Callable[[], np.ndarray | None] = lambda: None,
    ):
        self.robot, self.lock = robot, threading.Lock()
        self.link = CanLink(settings, [layout(name).frame_id for name in RECEIVED_FRAMES])
        self.lost_time = 0.0
        self.error: BaseException | None = None
        self._steer = steer
        self._period = min(max(robot.feedback_period, _SHORTEST_PERIOD), _LONGEST_PERIOD)
        self._on_truth, self._truth_every = on_truth, max(1, round(1.0 / truth_rate / self._period))
        self._steer_every = max(1, round(_STEER_PERIOD / self._period))
        # A copy takes the first step, so that compiling is over before the bus is open.
        copy.deepcopy(robot).step(0.02)
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Open the bus and start. Raises BusError."""
        self.link.open()
        # The thread that spins the node too: it holds the interpreter and the lock now and then, and while it waits for a processor the
        # robot would wait for it.
        take_precedence()
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
        try:
            self._loop()
        except Exception as error:  # the node reports it; a thread that dies silently would look like a dead bus
            self.error = error

    def _loop(self) -> None:
        deadline = wire_free = time.monotonic()
        count = 0
        while not self._stop.is_set():
            now = time.monotonic()
            deadline += self._period
            if now - deadline > _LONGEST_LAG:
                with self.lock:
                    skipped = self.robot.skip(now - deadline)
                self.lost_time += skipped
                deadline += skipped
            # What comes meanwhile waits in the socket: it takes effect with this step anyway.
            if (remaining := max(deadline, wire_free) - time.monotonic()) > 0.0:
                time.sleep(remaining)
            frames = self.link.receive(0.0)
            wanted = self._steer() if count % self._steer_every == 0 else None
            with self.lock:
                if wanted is not None:
                    self.robot.turn_base(wanted)
                sent = self.robot.step(self._period, frames)
                count += 1
                truth = self.robot.truth if count % self._truth_every == 0 else None
            if sent:
                self.link.send(sent)
                wire_free = max(wire_free, time.monotonic() - _BURST) + len(sent) * _FRAME_TIME
            if truth is not None:
                self._on_truth(truth)
