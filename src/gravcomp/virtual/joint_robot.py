"""The stand-in for a ros2_control robot in real time: a controller and what is behind it, in a thread.

on_trajectory(), on_values() --> JointController --> joints (servos of the virtual robot on its buses, or mock joints)
                                                     --on_state(), on_sample()--> caller
"""

import threading
import time
from collections.abc import Callable, Sequence

import can

from gravcomp.canbus import c610
from gravcomp.canbus.buses import CanBuses
from gravcomp.canbus.imu_stream import IMU_FRAMES, ImuSample, ImuStream
from gravcomp.canbus.precedence import take_precedence
from gravcomp.description.hardware import MOTOR_IDS, Hardware
from gravcomp.virtual.joint_controller import JointController, TrajectoryPoint
from gravcomp.virtual.joint_servos import JointState, MockJoints, ServoJoints

_SERVO_PERIOD = 0.004  # s


class JointRobot:
    """Runs the controller of `hardware.joints` in a thread.

    mock: joints whose state is their command, without a bus. `on_state` is called `rate` times a second, `on_sample` for each
    sample of the IMU board. Attributes: names (of the joints), controller, error (of the thread). Raises ValueError where the
    joints and the motors do not move the same cables.
    """

    def __init__(
        self,
        hardware: Hardware,
        rate: float,
        on_state: Callable[[JointState], None],
        on_sample: Callable[[ImuSample], None],
        *,
        mock: bool = False,
    ):
        assert hardware.joints is not None
        self.names = [motor.joint for motor in hardware.joints.motors]
        self.controller = JointController(self.names, hardware.joints.command)
        self.error: BaseException | None = None
        self._period, self._on_state, self._on_sample = 1.0 / rate, on_state, on_sample
        self._servos = None if mock else ServoJoints(hardware)
        self._mock = MockJoints([motor.zero or 0.0 for motor in hardware.joints.motors])
        frames = [*(c610.feedback_id(i) for i in MOTOR_IDS), *IMU_FRAMES]
        self._link = None if mock else CanBuses(hardware.all_buses, hardware.board_bus.name, frames)
        self._imu = ImuStream()
        self._lock = threading.Lock()
        self._ending = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Open the buses and start the thread. Raises BusError."""
        if self._link is not None:
            self._link.open()
        take_precedence()
        self._ending.clear()
        self._thread = threading.Thread(target=self._run, name="joint_robot", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Stop the thread and close the buses."""
        self._ending.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        if self._link is not None:
            self._link.close()

    def on_trajectory(self, names: Sequence[str], points: Sequence[TrajectoryPoint], start: float | None) -> str | None:
        """Take a trajectory that starts at `start` (s, host clock; None: now). Return None, or why it is refused."""
        begin = None if start is None else time.monotonic() + start - time.time()
        with self._lock:
            return self.controller.on_trajectory(names, points, begin, time.monotonic(), self._state.angles)

    def on_values(self, values: Sequence[float]) -> str | None:
        """Take positions (rad) or efforts (N m). Return None, or why they are refused."""
        with self._lock:
            return self.controller.on_values(values)

    @property
    def _state(self) -> JointState:
        return self._mock.state if self._servos is None else self._servos.state

    def _run(self) -> None:
        try:
            self._loop()
        except Exception as error:  # the node reports it
            self.error = error

    def _loop(self) -> None:
        last = next_step = next_state = time.monotonic()
        while not self._ending.is_set():
            wait = max(0.0, next_step - time.monotonic())
            frames = self._link.receive(wait) if self._link is not None else []
            if self._link is None:
                time.sleep(wait)
            for frame in frames:
                self._take(frame)
            now = time.monotonic()
            if now < next_step:
                continue
            next_step = max(next_step + _SERVO_PERIOD, now)
            with self._lock:
                wanted = self.controller.wanted(now)
                if self._servos is None:
                    self._mock.step(wanted, now - last)
                elif self._link is not None:
                    self._link.send(self._servos.step(wanted, now - last))
                last = now
                due = now >= next_state and (self._servos is None or self._servos.ready)
                state = self._state if due else None
            if state is not None:
                next_state = max(next_state + self._period, now)
                self._on_state(state)

    def _take(self, frame: can.Message) -> None:
        if frame.arbitration_id not in IMU_FRAMES:
            with self._lock:
                assert self._servos is not None
                self._servos.on_frame(frame, time.monotonic())
            return
        sample = self._imu.on_frame(frame, frame.timestamp or time.time())
        if sample is not None:
            self._on_sample(sample)
