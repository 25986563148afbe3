"""States, requests and commands that every bridge has, whatever drives its motors. It has no threads and no clock of its own.

The caller passes commands and requests with the time (s, monotonic). A bridge derives from it and says what its motors are.

    HOLDING --good commands--> ACTIVE --stale or refused command, stale IMU--> HOLDING
    any driving --fault--> FAULT --over for a while; when latched ~/resume--> as after activation
    any --stop--> STOPPED;  --release--> cables paid out, then STOPPED
"""

import abc
import math
from collections.abc import Sequence
from typing import Protocol

from gravcomp.description.hardware import Watchdog
from gravcomp.description.transmission import Transmission
from gravcomp.motors.command_check import CommandCheck
from gravcomp.motors.state import DRIVING, State

GOOD_COMMANDS = 3
"""Acceptable commands in a row after which HOLDING becomes ACTIVE."""

_RECOVERY_TIME = 0.2  # s without anything missing, after which a fault that is not latched is over
_LONGEST_STEP = 0.02  # s; after a longer pause the loops continue as if only this time had passed
_LONGEST_PAUSE = 0.1  # s between two ticks. The guard zeroes the currents then, and the cables may have moved


class Loops(Protocol):
    """What moves the motors to their targets; displacements are those at the capstans."""

    @property
    def arrived(self) -> bool:
        """Whether every setpoint is on its target."""

    def follow(self, displacement: Sequence[float], tension: Sequence[float]) -> None:
        """Set targets (m) and expected forces (N; none: 0)."""

    def hold(self) -> None:
        """Keep the cables where their setpoints are now."""

    def pay_out(self) -> None:
        """Move all cables to where none is pulled in."""

    def no_current(self) -> None:
        """Set what is commanded to nothing."""


class Supervisor(abc.ABC):
    """Changes the state of a bridge by requests, commands and time.

    With `require_imu` the bridge holds the cables while no IMU samples come. `idle` says what the motors do while they are not
    driven, `recovery` what the user can do about a latched fault or a stop. Attributes: state, message (its reason),
    refused_commands (counter).
    """

    def __init__(
        self,
        transmission: Transmission,
        watchdog: Watchdog,
        check: CommandCheck,
        loops: Loops,
        *,
        require_imu: bool,
        idle: str,
        recovery: str,
    ):
        self.state, self.message = State.UNCONFIGURED, "no bus"
        self.refused_commands = 0
        self._transmission, self._watchdog, self._check, self._loops = transmission, watchdog, check, loops
        self._require_imu, self._idle, self._recovery = require_imu, idle, recovery
        self._stamp: object | None = None
        self._command_time = self._imu_time = -math.inf
        self._good_commands = 0
        self._releasing = False
        self._complete_since: float | None = None
        self._latched = False
        self._last_tick: float | None = None

    # Requests. Those of the user return whether they succeeded, and a sentence for the user.

    def unconfigure(self) -> None:
        """Enter UNCONFIGURED: there is no way to the motors."""
        self._enter(State.UNCONFIGURED, "no bus")

    def activate(self, now: float) -> None:
        """Wait for the feedback of all motors, then drive them."""
        self._latched, self._complete_since, self._imu_time = False, None, now
        self._enter(State.FAULT, "waiting for the feedback of all motors")

    def deactivate(self) -> None:
        """Enter INACTIVE: no motor is driven."""
        self._enter(State.INACTIVE, f"deactivated, {self._idle}")

    def stop(self, why: str = "stop requested") -> tuple[bool, str]:
        """Drive no motor from the next tick on."""
        if self.state in (State.UNCONFIGURED, State.INACTIVE):
            return True, "no motor is driven"
        if not self._latched:
            self._enter(State.STOPPED, f"stopped, {self._idle}: {why}{self._recovery}")
        return True, self.message

    def resume(self, now: float) -> tuple[bool, str]:
        """Leave STOPPED or a latched FAULT; hold the cables where they are now."""
        if self.state not in (State.STOPPED, State.FAULT):
            return self.state in DRIVING, f"nothing to resume: the state is {self.state.name}"
        missing = self._missing(now)
        if missing:
            return False, f"cannot resume: {missing}"
        self._accept()
        self._begin(now)
        return self.state in DRIVING, self.message

    def release(self, now: float) -> tuple[bool, str]:
        """Pay all cables out to `displacement_min`, then stop. Stop immediately when the zero position is unknown."""
        if self.state not in DRIVING or not (self._zeros_known and self._can_follow):
            done, _ = self.stop("release requested")
            return done, f"{self._idle}; the cables were not paid out because the motors were not driving or have no zero"
        self._enter(State.HOLDING, "paying the cables out")
        self._releasing = True
        self._loops.pay_out()
        return True, self.message

    # Inputs.

    def on_imu_sample(self, now: float) -> None:
        """Take note of a valid IMU sample."""
        self._imu_time = now

    def imu_lost(self, why: str) -> None:
        """Hold immediately: IMU samples come, but they are not valid."""
        self._imu_time = -math.inf
        if self.state is State.ACTIVE and self._require_imu:
            self._hold(why)

    def command(
        self,
        displacement: Sequence[float],
        tension: Sequence[float],
        now: float,
        *,
        age: float = 0.0,
        stamp: object | None = None,
    ) -> str | None:
        """Take a command: displacement (m) and expected tension (N, may be empty) of every cable.

        `age` (s) is that of the IMU sample from which the command was computed; `stamp` appears in the snapshot. Return
        None when the command is followed, else the reason why it is refused.
        """
        if self.state not in (State.ACTIVE, State.HOLDING) or self._releasing or not self._can_follow:
            return f"not following commands: {self.message}"
        reason = self._check.objection(displacement, tension, now, age)
        if reason is None and self._imu_is_stale(now):
            reason = "there are no good IMU samples"
        if reason:
            self.refused_commands += 1
            self._good_commands = 0
            if self.state is State.ACTIVE:
                self._hold(f"command refused: {reason}")
            else:
                self.message = f"command refused: {reason}"
            return reason
        self._loops.follow(self._transmission.motors(displacement), self._transmission.forces(tension) if len(tension) else [])
        # Time of the IMU sample: commands that still wait in queues after a node has died do not keep the bridge active.
        self._command_time, self._stamp = now - max(age, 0.0), stamp
        self._good_commands += 1
        if self.state is State.HOLDING and self._good_commands >= GOOD_COMMANDS:
            self._enter(State.ACTIVE, "following commands")
        return None

    # What a bridge says about its motors.

    @property
    @abc.abstractmethod
    def _zeros_known(self) -> bool:
        """Whether the zero positions of all motors are known."""

    @property
    def _can_follow(self) -> bool:
        """Whether every motor can be driven."""
        return True

    @abc.abstractmethod
    def _missing(self, now: float) -> str | None:
        """Motors that do not answer, in words."""

    @abc.abstractmethod
    def _clear_faults(self) -> None:
        """Forget the faults so far, latched ones as well."""

    def _accept(self) -> None:
        """Take the motors as they are, because the user says so."""
        self._clear_faults()

    @abc.abstractmethod
    def _begin(self, now: float) -> None:
        """Hold the cables after activation or a fault; all motors answer."""

    @abc.abstractmethod
    def _watch(self, now: float) -> None:
        """Check for faults and change the state."""

    @abc.abstractmethod
    def _drive(self, now: float, dt: float) -> None:
        """Compute what is commanded in this period of `dt` s."""

    # Changes of the state.

    def _advance(self, now: float) -> float:
        """Run one control period; return its duration (s) as the loops take it."""
        elapsed = 0.0 if self._last_tick is None else max(now - self._last_tick, 0.0)
        self._last_tick = now
        dt = min(elapsed, _LONGEST_STEP)
        if self.state in (State.UNCONFIGURED, State.INACTIVE):
            return dt
        if elapsed > _LONGEST_PAUSE and self.state in DRIVING:
            self._fault(f"the bridge was delayed by {1e3 * elapsed:.0f} ms", latched=False)
        self._watch(now)
        if self.state in DRIVING:
            self._drive(now, dt)
        if self.state not in DRIVING:
            self._loops.no_current()
        return dt

    def _enter(self, state: State, message: str) -> None:
        if state is not State.ACTIVE:
            self._good_commands = 0
        self._releasing = False
        self.state, self.message = state, message

    def _fault(self, message: str, *, latched: bool) -> None:
        self._latched = self._latched or latched
        self._complete_since = None
        self._loops.no_current()
        self._enter(State.FAULT, message + (self._recovery if latched else ""))

    def _hold(self, message: str) -> None:
        """Keep the cables where their setpoints are now."""
        self._loops.hold()
        self._enter(State.HOLDING, message)

    def _await(self, missing: str | None, now: float) -> None:
        """Continue as after activation when nothing has been missing for a while."""
        if missing:
            self._complete_since = None
            self.message = missing
            return
        self._complete_since = now if self._complete_since is None else self._complete_since
        if now - self._complete_since >= _RECOVERY_TIME:
            self._clear_faults()
            self._begin(now)

    def _watch_ages(self, now: float) -> None:
        """Hold when the command or the IMU sample has become too old."""
        if self.state is State.ACTIVE:
            if now - self._command_time > self._watchdog.command_timeout:
                self._hold(f"no command from an IMU sample of the last {1e3 * self._watchdog.command_timeout:.0f} ms")
            elif self._imu_is_stale(now):
                self._hold(f"no IMU sample for {1e3 * self._watchdog.imu_timeout:.0f} ms")

    def _end_step(self, fault: str | None) -> None:
        """Take the fault of a motor in a step of the loops, or end a release that is done."""
        if fault:
            self._fault(fault, latched=True)
        elif self._releasing and self._loops.arrived:
            self._enter(State.STOPPED, f"cables paid out, {self._idle}{self._recovery}")

    def _imu_is_stale(self, now: float) -> bool:
        return self._require_imu and now - self._imu_time > self._watchdog.imu_timeout
