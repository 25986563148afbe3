"""The thread that runs a JointBridge: it controls at its own rate, independently of the rest of the process.

on_joint_states(), command() --> JointBridge --send()--> controller       every control period, and after each command
                                             --on_snapshot()--> caller    at the state rate, and at each change
"""

import dataclasses
import sys
import threading
import time
from collections.abc import Callable, Sequence

from gravcomp.canbus.precedence import take_precedence
from gravcomp.description.hardware import Hardware
from gravcomp.motors.joint_bridge import JointBridge
from gravcomp.motors.state import CableSnapshot, State

_SWITCH_INTERVAL = 5e-4  # s; with Python's default of 5 ms the thread of the messages could delay the control by as much
_LAST_TIMES = 5  # messages at the end of the bridge
_CLOCK_SET = 0.02  # s; a jump of the host's clock, which otherwise is slowed or hurried by microseconds


@dataclasses.dataclass(frozen=True)
class JointDriverOptions:
    """Options of the driver."""

    rate: float = 250.0  # Hz, of the control
    state_rate: float = 50.0  # Hz, of the snapshots; every change of the state gives an additional one
    require_imu: bool = False  # hold the cables while no IMU samples come


class JointDriver:
    """Runs a JointBridge in a thread.

    `send` takes what the controller is sent (rad or N m), `on_snapshot` the state; both are called from the thread, `send` also
    from the thread of a command. `controller` returns None while the controller is there, else why it is not. `beat` is called
    every period and returns whether there is a guard. Attributes: bridge; overruns (control periods that were late by more than
    one period); delay (s, from IMU sample to command, of the last one).
    """

    def __init__(
        self,
        hardware: Hardware,
        options: JointDriverOptions,
        send: Callable[[Sequence[float]], None],
        on_snapshot: Callable[[CableSnapshot], None],
        controller: Callable[[], str | None] = lambda: None,
        beat: Callable[[], bool] = lambda: True,
    ):
        self.bridge = JointBridge(hardware, require_imu=options.require_imu)
        self.overruns, self.delay = 0, 0.0
        self._options, self._send, self._on_snapshot, self._controller = options, send, on_snapshot, controller
        self._beat = beat
        self._wall = time.time() - time.monotonic()
        self._lock = threading.Lock()
        self._ending = threading.Event()
        self._thread: threading.Thread | None = None

    def open(self) -> None:
        """Start the thread; nothing is sent to the controller."""
        # For the calling thread and those that it starts: joint states must not wait longer than the control does.
        take_precedence()
        sys.setswitchinterval(_SWITCH_INTERVAL)
        self.bridge.configure()
        self._ending.clear()
        self._thread = threading.Thread(target=self._run, name="joint_bridge", daemon=True)
        self._thread.start()

    def activate(self) -> None:
        """Start to drive the joints."""
        with self._lock:
            self.bridge.activate(time.monotonic())

    def deactivate(self) -> None:
        """Stop driving; a controller of efforts is sent zeros."""
        with self._lock:
            self.bridge.deactivate()
            last = self.bridge.last()
            if last is not None:
                for _ in range(_LAST_TIMES):
                    self._send(last)

    def close(self) -> None:
        """Stop driving and end the thread."""
        self.deactivate()
        self._ending.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        with self._lock:
            self.bridge.unconfigure()

    def on_joint_states(
        self, names: Sequence[str], angles: Sequence[float], speeds: Sequence[float], efforts: Sequence[float], stamp_ns: int
    ) -> None:
        """Take a message of joint states."""
        with self._lock:
            now = time.monotonic()
            wall = time.time() - now
            if abs(wall - self._wall) > _CLOCK_SET:  # senders on this host have the new time, and are not late by the difference
                self._wall = wall
                self.bridge.joints.forget_clocks()
            self.bridge.on_joint_states(names, angles, speeds, efforts, now, stamp_ns, now + self._wall)

    def command(self, displacement: Sequence[float], tension: Sequence[float], stamp_ns: int) -> str | None:
        """Take a command as `Supervisor.command` does, and send to the controller immediately.

        `stamp_ns` (host clock) is the stamp of the IMU sample from which the command was computed, 0 for none.
        """
        age = time.time() - 1e-9 * stamp_ns if stamp_ns else 0.0
        with self._lock:
            now = time.monotonic()
            reason = self.bridge.command(displacement, tension, now, age=age, stamp=stamp_ns)
            if reason is None:
                self.delay = age
                self._tick(now)
        return reason

    def request(self, action: Callable[[JointBridge, float], tuple[bool, str]]) -> tuple[bool, str]:
        """Call `action(bridge, now)`, send what follows immediately, and return its answer."""
        with self._lock:
            now = time.monotonic()
            answer = action(self.bridge, now)
            self._tick(now)
        return answer

    def snapshot(self) -> CableSnapshot:
        """Return the present state of the bridge and the cables."""
        with self._lock:
            return self.bridge.snapshot()

    def _tick(self, now: float) -> None:
        values = self.bridge.tick(now)
        if values is not None:
            self._send(values)

    def _run(self) -> None:
        period, state_period = 1.0 / self._options.rate, 1.0 / self._options.state_rate
        next_tick = next_state = time.monotonic()
        reported: State | None = None
        while not self._ending.wait(max(0.0, next_tick - time.monotonic())):
            missing, guarded = self._controller(), self._beat()
            with self._lock:
                now = time.monotonic()
                self.overruns += now > next_tick + period
                next_tick = max(next_tick + period, now)
                try:
                    self.bridge.controller(missing)
                    if not guarded:
                        self.bridge.stop("the guard is gone")
                    self._tick(now)
                except Exception as error:  # without the thread the joints would follow the last command for ever
                    self.bridge.stop(f"error in the bridge: {error!r}")
                changed = self.bridge.state is not reported
                snapshot = self.bridge.snapshot() if changed or now >= next_state else None
            if snapshot is not None:
                next_state = now + state_period
                reported = snapshot.state
                self._on_snapshot(snapshot)
