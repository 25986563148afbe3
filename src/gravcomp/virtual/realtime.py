"""The virtual robot in real time, on its CAN buses.

A thread receives the frames that have arrived, steps the robot and sends its frames, once every period. After a pause of the
machine it catches up, but not faster than a wire of 1 Mbit/s carries the frames. A lag above `_LONGEST_LAG` is skipped: frames
are lost (counted in `lost_time`), but virtual time follows the clock, so rates and stamps stay consistent. While a motor turns so
fast that the bridge would lose count of its turns, which is a fault, the robot goes on to catch up, up to `_LONGEST_TURNING`.
"""

import copy
import threading
import time
from collections.abc import Callable

import numpy as np

from gravcomp.canbus import c610
from gravcomp.canbus.buses import CanBuses
from gravcomp.canbus.codec import layout
from gravcomp.canbus.precedence import take_precedence
from gravcomp.description.hardware import Hardware
from gravcomp.virtual.emulated_board import LOOP_FRAMES
from gravcomp.virtual.robot import VirtualRobot
from gravcomp.virtual.truth import Truth

_SHORTEST_PERIOD, _LONGEST_PERIOD = 0.002, 0.004  # s, between two steps; in between, the period of the motors' feedback
_FRAME_TIME = 0.11e-3  # s, one frame on a wire of 1 Mbit/s
_BURST = 0.02  # s of frames sent together after a pause; receivers' socket buffers hold about 30 ms
_LONGEST_LAG = 0.1  # s
_LONGEST_TURNING = 0.5  # s; motors run fast for as long as the robot straightens
_STEER_PERIOD = 0.01  # s

RECEIVED_FRAMES = (*c610.COMMANDS, "HeaterCommand", "BoardRequest")


class RealtimeRobot:
    """Runs a virtual robot on the buses of `hardware` in a thread. Other threads must hold `lock` while they use the robot."""

    def __init__(
        self,
        robot: VirtualRobot,
        hardware: Hardware,
        on_truth: Callable[[Truth], None],
        truth_rate: float,
        steer: Callable[[], np.ndarray | None] = lambda: None,
    ):
        """`on_truth` is called from the thread `truth_rate` times a second, `steer` every 10 ms.

        `steer` returns the orientation (3, 3), world from soft_base, to turn the base to, or None. Compiles the kernels first.
        """
        self.robot, self.lock = robot, threading.Lock()
        received = [*(layout(name).frame_id for name in RECEIVED_FRAMES), *LOOP_FRAMES]
        self.link = CanBuses(hardware.all_buses, hardware.board_bus.name, received)
        self._wires = len(hardware.all_buses)
        self.lost_time = 0.0
        self.error: BaseException | None = None
        self._steer = steer
        self._period = min(max(robot.feedback_period, _SHORTEST_PERIOD), _LONGEST_PERIOD)
        self._on_truth, self._truth_every = on_truth, max(1, round(1.0 / truth_rate / self._period))
        self._steer_every = max(1, round(_STEER_PERIOD / self._period))
        # A copy takes the first step, so that compilation ends before the bus is opened.
        copy.deepcopy(robot).step(0.02)
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Open the bus and start the thread. Raises BusError."""
        self.link.open()
        # The calling thread, which spins the node, gets precedence, too. It occasionally holds the interpreter and the lock;
        # while it then waited for a processor, the robot would wait, too.
        take_precedence()
        self._stop.clear()
        self._thread = threading.Thread(target=self._run, name="virtual_robot", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Stop the thread and close the bus; nothing is sent afterwards."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        self.link.close()

    def _run(self) -> None:
        try:
            self._loop()
        except Exception as error:  # the node reports it; a thread that ends silently would look like a dead bus
            self.error = error

    def _skip(self, lag: float) -> float:
        """Skip a lag (s) where that loses no turn of a motor, or where it is too long. Return how much was skipped (s)."""
        with self.lock:
            return self.robot.skip(lag) if lag > _LONGEST_TURNING or self.robot.keeps_turns(lag) else 0.0

    def _loop(self) -> None:
        deadline = wire_free = time.monotonic()
        count = 0
        while not self._stop.is_set():
            now = time.monotonic()
            deadline += self._period
            if (lag := now - deadline) > _LONGEST_LAG:
                skipped = self._skip(lag)
                self.lost_time += skipped
                deadline += skipped
            # Frames that arrive meanwhile wait in the socket; they take effect with this step.
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
                wire_free = max(wire_free, time.monotonic() - _BURST) + len(sent) / self._wires * _FRAME_TIME
            if truth is not None:
                self._on_truth(truth)
