"""The states of the bridge and everything that may change them; no threads, no clock, no bus of its own.

The caller passes frames, commands and requests with the time (s, monotonic), and calls `tick` at the control rate: it
returns the frames to be sent. The table of states and causes is in gravcomp_hw/README.md.

    INACTIVE --activate--> FAULT (waiting for feedback) --all motors answer--> HOLDING, HOMING or STOPPED (`zero`)
    HOLDING --good commands--> ACTIVE --stale or refused command, stale IMU--> HOLDING
    any --bus, feedback--> FAULT --they are back--> as after activation
    any --stall, runaway, encoder, wrong id, turns not certain--> FAULT, until resume or home
    any --stop--> STOPPED;  --release--> cables paid out, then STOPPED;  --home--> HOMING --> HOLDING
"""

import math
from collections.abc import Sequence

import can

from gravcomp.canbus import codec
from gravcomp.description.hardware import COUNTS_PER_TURN, MOTOR_IDS, Hardware
from gravcomp.motors.encoder import JUMPS, Encoder
from gravcomp.motors.homing import HomingProcedure, Phase
from gravcomp.motors.loop import PositionLoop
from gravcomp.motors.monitor import MotorMonitor
from gravcomp.motors.output import CurrentOutput
from gravcomp.motors.state import DRIVING, CableSnapshot, RotorRecord, State, ZeroRecord

ZERO_POLICIES = ("start", "home", "home_at_start")
"""Where zero is when nobody knows: where the cables are ('start'); unknown until ~/home; found by homing at once."""

GOOD_COMMANDS = 3
"""As many acceptable commands in a row as lead from HOLDING to ACTIVE."""

_RECOVERY_TIME = 0.2  # s of complete feedback after which a lost motor counts as back
_WRONG_ID_FRAMES = 20  # feedbacks of a motor that no cable has, with no longer pause between two of them than
_WRONG_ID_PAUSE = 0.1  # s
_LONGEST_STEP = 0.02  # s; after a longer pause the loops go on as if only this had passed
_LONGEST_PAUSE = 0.1  # s between two ticks; the guard takes over then, and where the cables went meanwhile is to be seen first
_WAY_BACK = "; ~/resume or ~/home goes on"
_MARGIN = 5e-5  # m beyond a displacement limit that is rounding, not a mistake


class Bridge:
    """Motors of `hardware` under the states above; `zero` is one of ZERO_POLICIES, `require_imu` holds without IMU samples."""

    def __init__(self, hardware: Hardware, *, zero: str = "start", require_imu: bool = True):
        if zero not in ZERO_POLICIES:
            raise ValueError(f"zero is '{zero}'; allowed: {', '.join(ZERO_POLICIES)}")
        self.state, self.message = State.UNCONFIGURED, "no bus"
        self.rejected_frames = 0
        self.refused_commands = 0
        self.report = ""  # of the last homing
        self._hardware, self._zero_policy, self._require_imu = hardware, zero, require_imu
        self._index = {motor.can_id: i for i, motor in enumerate(hardware.motors)}
        n = len(hardware.motors)
        self._encoders = [Encoder() for _ in range(n)]
        self._loops = [PositionLoop(hardware.drive) for _ in range(n)]
        self._monitors = [MotorMonitor(hardware.drive, hardware.watchdog) for _ in range(n)]
        self._zeros: list[int | None] = [None] * n
        self._output = CurrentOutput([m.can_id for m in hardware.motors], hardware.drive.current_limit)
        self._target, self._tension, self._currents = [0.0] * n, [0.0] * n, [0.0] * n
        self._stamp: object | None = None
        self._last_seen: list[float] | None = None
        self._last_seen_time = self._command_time = self._imu_time = -math.inf
        self._good = 0
        self._homing: HomingProcedure | None = None
        self._releasing = False
        self._complete_since: float | None = None
        self._latched = False
        self._unsure_told = False
        self._strangers: dict[int, tuple[int, float]] = {}  # id -> feedbacks in a row, time of the last
        self._last_tick: float | None = None

    # Requests. Each returns what happened, for people.

    def configure(self) -> None:
        """The bus is open."""
        self._enter(State.INACTIVE, "bus open, no current")

    def unconfigure(self, why: str = "no bus") -> None:
        self._enter(State.UNCONFIGURED, why)

    def activate(self, now: float) -> None:
        """From here on the motors may get current: as soon as all of them answer."""
        self._latched, self._unsure_told, self._complete_since, self._imu_time = False, False, None, now
        self._enter(State.FAULT, "waiting for the feedback of all motors")

    def deactivate(self) -> None:
        self._enter(State.INACTIVE, "deactivated, no current")

    def stop(self, why: str = "asked for by stop") -> tuple[bool, str]:
        """Zero current from the next frame on."""
        if self.state in (State.UNCONFIGURED, State.INACTIVE):
            return True, "no motor gets current anyway"
        if not self._latched:
            self._enter(State.STOPPED, f"stopped, no current: {why}{_WAY_BACK}")
        return True, self.message

    def resume(self, now: float) -> tuple[bool, str]:
        """From STOPPED or a latched FAULT back to HOLDING, where the cables are now."""
        if self.state not in (State.STOPPED, State.FAULT):
            return self.state in DRIVING, f"nothing to resume: {self.state.name.lower()}"
        missing = self._missing(now)
        if missing:
            return False, f"cannot resume: {missing}"
        self._clear_faults()
        self._trust_turns()
        self._begin(now)
        return self.state in DRIVING, self.message

    def release(self, now: float) -> tuple[bool, str]:
        """Pay all cables out to their farthest displacement, then no current. Without a known zero: no current at once."""
        if self.state not in DRIVING or None in self._zeros:
            done, _ = self.stop("asked for by release")
            return done, "no current; the cables were not paid out because the motors were not driving or have no zero"
        self._enter(State.HOLDING, "paying the cables out")
        self._releasing = True
        self._target = [self._hardware.drive.displacement_min] * len(self._target)
        self._tension = [0.0] * len(self._tension)
        return True, self.message

    def home(self, now: float) -> tuple[bool, str]:
        """Find the zero of every cable; also the way back from a fault of a motor."""
        if self.state in (State.UNCONFIGURED, State.INACTIVE):
            return False, "not active: activate the bridge first"
        if self.state is State.HOMING:
            return False, "is homing already"
        missing = self._missing(now)
        if missing:
            return False, f"cannot home: {missing}"
        self._clear_faults()
        self._start_homing(now)
        return True, self.message

    # What comes in.

    def on_frame(self, message: can.Message, now: float) -> None:
        """Take a frame; all but motor feedback is ignored, what cannot be right is counted."""
        motor_id = message.arbitration_id - 0x200
        if motor_id not in MOTOR_IDS or message.is_extended_id:
            return
        try:
            feedback = codec.decode(message).values
        except codec.FrameError:
            self.rejected_frames += 1
            return
        index = self._index.get(motor_id)
        if index is None:
            count, last = self._strangers.get(motor_id, (0, now))
            self._strangers[motor_id] = (count + 1 if now - last < _WRONG_ID_PAUSE else 1, now)
            return
        encoder = self._encoders[index]
        if self._hardware.watchdog.zero_timeout < now - encoder.time < math.inf:
            encoder.forget()
            self._zeros[index] = None
        if not encoder.update(feedback.angle, feedback.speed, feedback.current, now):
            self.rejected_frames += 1

    def on_imu_sample(self, now: float) -> None:
        """A valid IMU sample came."""
        self._imu_time = now

    def imu_lost(self, why: str) -> None:
        """IMU samples come, but cannot be trusted: hold at once."""
        self._imu_time = -math.inf
        if self.state is State.ACTIVE and self._require_imu:
            self._hold(why)

    def bus_lost(self, why: str) -> None:
        """The bus is gone; it is back when all motors answer again."""
        if self.state in DRIVING:
            self._fault(f"CAN bus lost: {why}", latched=False)

    def command(
        self,
        displacement: Sequence[float],
        tension: Sequence[float],
        now: float,
        *,
        age: float = 0.0,
        stamp: object | None = None,
    ) -> str | None:
        """A command: displacement (m) and expected tension (N, may be empty) a cable.

        `age` (s) is that of the IMU sample behind it; `stamp` is handed through to the snapshot. Returns None when it is
        followed, else why it is refused.
        """
        if self.state not in (State.ACTIVE, State.HOLDING) or self._releasing:
            return f"not following commands: {self.message}"
        reason = self._objection(displacement, tension, now, age)
        if reason:
            self.refused_commands += 1
            self._good = 0
            if self.state is State.ACTIVE:
                self._hold(f"command refused: {reason}")
            elif self.state is State.HOLDING:
                self.message = f"command refused: {reason}"
            return reason
        drive = self._hardware.drive
        self._target = [min(max(x, drive.displacement_min), drive.displacement_max) for x in displacement]
        self._tension = list(tension) or [0.0] * len(self._target)
        # When its sample was taken: what comes late out of queues behind a dead node does not keep the bridge going.
        self._command_time, self._stamp = now - max(age, 0.0), stamp
        self._good += 1
        if self.state is State.HOLDING and self._good >= GOOD_COMMANDS:
            self._enter(State.ACTIVE, "following commands")
        return None

    def restore(self, record: ZeroRecord) -> None:
        """Go on with the turns and zeros that a guard kept, for the motors that it knows and whose zero this bridge does not.

        Feedback that came before does not matter: a count begun from it knows the angle, not the turns.
        """
        for can_id, index in self._index.items():
            if can_id in record and self._zeros[index] is None:
                rotor = record[can_id]
                self._encoders[index].restore(rotor.count, rotor.speed, rotor.time, rotor.certain)
                self._zeros[index] = rotor.zero

    # What goes out.

    def tick(self, now: float) -> list[can.Message]:
        """One control period: watch, move on in the states, compute the currents. The frames to be sent."""
        elapsed = 0.0 if self._last_tick is None else max(now - self._last_tick, 0.0)
        self._last_tick = now
        if self.state in (State.UNCONFIGURED, State.INACTIVE):
            return []
        if elapsed > _LONGEST_PAUSE and self.state in DRIVING:
            self._fault(f"the bridge was held up for {1e3 * elapsed:.0f} ms", latched=False)
        self._watch(now)
        if self.state in DRIVING:
            self._drive(now, min(elapsed, _LONGEST_STEP))
        if self.state not in DRIVING:
            self._currents = [0.0] * len(self._currents)
        return self._output.frames(self._currents, enabled=self.state in DRIVING)

    def zero_frames(self) -> list[can.Message]:
        """Frames without current, for the end."""
        return self._output.zero()

    def snapshot(self) -> CableSnapshot:
        drive = self._hardware.drive
        return CableSnapshot(
            state=self.state,
            message=self.message,
            command=list(self._target),
            displacement=self._displacements(),
            velocity=self._velocities(),
            current=[self._sense(i) * encoder.current for i, encoder in enumerate(self._encoders)],
            tension=[
                max(0.0, self._sense(i) * encoder.current * drive.tension_per_ampere) for i, encoder in enumerate(self._encoders)
            ],
            stamp=self._stamp if self.state is State.ACTIVE else None,
        )

    def zero_record(self) -> ZeroRecord | None:
        """Turns and zeros to be kept for a later run; None while any is unknown. While homing, the zeros from before."""
        zeros = self._zeros_before_homing if self._homing else self._zeros
        if None in zeros or any(encoder.count is None for encoder in self._encoders):
            return None
        return {
            can_id: RotorRecord(encoder.count, zeros[i], encoder.speed, encoder.time, encoder.certain)
            for (can_id, i), encoder in zip(self._index.items(), self._encoders)
        }

    # How states change.

    def _enter(self, state: State, message: str) -> None:
        if self._homing and state is not State.HOMING:
            if self._homing.phase is not Phase.DONE:
                self._zeros = self._zeros_before_homing
            self._homing = None
        if state is not State.ACTIVE:
            self._good = 0
        self._releasing = False
        self.state, self.message = state, message

    def _fault(self, message: str, *, latched: bool) -> None:
        self._latched = self._latched or latched
        self._complete_since = None
        self._currents = [0.0] * len(self._currents)
        self._enter(State.FAULT, message + (_WAY_BACK if latched else ""))

    def _hold(self, message: str) -> None:
        """Keep the displacement where the cables are now."""
        self._target = [loop.setpoint for loop in self._loops]
        self._enter(State.HOLDING, message)

    def _watch(self, now: float) -> None:
        """In a fixed order: turns, bus and feedback, wrong ids, encoders, staleness."""
        self._watch_turns()
        missing = self._missing(now)
        if self.state in DRIVING and missing:
            self._fault(missing, latched=False)
        if self.state is State.FAULT and not self._latched:
            self._await_feedback(missing, now)
        if self.state not in DRIVING:
            return
        strangers = [str(i) for i, (count, _) in self._strangers.items() if count >= _WRONG_ID_FRAMES]
        if strangers:
            self._fault(f"motor id {', '.join(strangers)} answers, but no cable has it: check the ids of the C610", latched=True)
            return
        for motor, encoder in zip(self._hardware.motors, self._encoders):
            if encoder.jumps >= JUMPS:
                self._fault(f"{self._name(motor)}: the rotor's angle jumps; do two C610 have this id?", latched=True)
                return
        watchdog = self._hardware.watchdog
        if self.state is State.ACTIVE:
            if now - self._command_time > watchdog.command_timeout:
                self._hold(f"no command by an IMU sample of the last {1e3 * watchdog.command_timeout:.0f} ms")
            elif self._require_imu and now - self._imu_time > watchdog.imu_timeout:
                self._hold(f"no IMU sample for {1e3 * watchdog.imu_timeout:.0f} ms")

    def _watch_turns(self) -> None:
        """A count of turns that is not certain must not be driven by, until somebody has decided or homing has found the zero."""
        motors = zip(self._hardware.motors, self._encoders, self._zeros)
        unsure = [
            self._name(motor)
            for motor, encoder, zero in motors
            if not encoder.certain and not encoder.settling and zero is not None
        ]
        if not unsure or self._unsure_told or self.state is State.HOMING:
            return
        turn = 1e3 * COUNTS_PER_TURN * self._hardware.drive.travel_per_count
        what = f"the turns of {', '.join(unsure)} could not be counted: the zero may be off by {turn:.2f} mm or a multiple"
        self._fault(f"{self.message.removesuffix(_WAY_BACK)}; {what}" if self._latched else what, latched=True)
        self._unsure_told = True

    def _await_feedback(self, missing: str | None, now: float) -> None:
        if missing:
            self._complete_since = None
            self.message = missing
            return
        self._complete_since = now if self._complete_since is None else self._complete_since
        if now - self._complete_since >= _RECOVERY_TIME:
            self._clear_faults()
            self._begin(now)

    def _begin(self, now: float) -> None:
        """All motors answer: hold here, or find the zero first."""
        if None in self._zeros:
            if self._zero_policy == "home":
                self._enter(State.STOPPED, "not homed: ~/home finds the zero of the cables")
                return
            if self._zero_policy == "home_at_start":
                self._start_homing(now)
                return
            self._zeros = [e.count if z is None else z for z, e in zip(self._zeros, self._encoders)]
        self._reset_loops()
        self._hold("waiting for commands")

    def _start_homing(self, now: float) -> None:
        self._zeros_before_homing = self._zeros
        self._zeros = [encoder.count for encoder in self._encoders]
        self._reset_loops()
        self._homing = HomingProcedure(
            self._hardware.homing, self._hardware.drive, self._hardware.cables, self._displacements(), now
        )
        self._tension = [0.0] * len(self._tension)
        self._enter(State.HOMING, self._homing.progress)

    def _reset_loops(self) -> None:
        for loop, displacement, monitor in zip(self._loops, self._displacements(), self._monitors):
            loop.reset(displacement)
            monitor.reset()

    def _clear_faults(self) -> None:
        self._latched = self._unsure_told = False
        self._strangers.clear()
        for encoder in self._encoders:
            if encoder.jumps >= JUMPS:
                encoder.resynchronise()

    def _trust_turns(self) -> None:
        for encoder in self._encoders:
            encoder.trust()

    def _drive(self, now: float, dt: float) -> None:
        """The currents of this period (A, in the motor's own sense)."""
        if any(encoder.settling for encoder in self._encoders):  # a turn too many is no distance to make good
            self._currents = [0.0] * len(self._currents)
            return
        displacement, velocity = self._displacements(), self._velocities()
        targets, limit = self._target, None
        if self._homing:
            measured = [self._sense(i) * encoder.current for i, encoder in enumerate(self._encoders)]
            targets, limit = self._homing.step(displacement, measured, now), self._hardware.homing.velocity
            if self._homing.phase in (Phase.DONE, Phase.FAILED):
                self._end_homing(displacement)
                return
            self.message = self._homing.progress
        for i, loop in enumerate(self._loops):
            current = loop.step(targets[i], self._tension[i], displacement[i], velocity[i], dt, limit)
            reason = self._monitors[i].update(self._encoders[i].time, current, velocity[i], loop.setpoint - displacement[i])
            if reason:
                self._fault(f"{self._name(self._hardware.motors[i])} {reason}", latched=True)
                return
            self._currents[i] = self._sense(i) * current
        if self._releasing and all(loop.setpoint == self._target[i] for i, loop in enumerate(self._loops)):
            self._enter(State.STOPPED, f"cables paid out, no current{_WAY_BACK}")

    def _end_homing(self, displacement: list[float]) -> None:
        homing, travel = self._homing, self._hardware.drive.travel_per_count
        self.report = homing.report
        if homing.phase is Phase.FAILED:
            self._fault(f"homing failed: {homing.failure}", latched=True)
            return
        self._zeros = [
            zero + round(motor.direction * (taut - motor.offset) / travel)
            for zero, taut, motor in zip(self._zeros, homing.zeros, self._hardware.motors)
        ]
        self._trust_turns()
        self._reset_loops()
        self._hold(f"homed: {homing.report}")
        self._target = [0.0] * len(self._target)

    # Reading the motors.

    def _objection(self, displacement: Sequence[float], tension: Sequence[float], now: float, age: float) -> str | None:
        """Why a command cannot be followed. In a fixed order: size, numbers, limits, age, jump, IMU."""
        n, drive, watchdog = len(self._loops), self._hardware.drive, self._hardware.watchdog
        if len(displacement) != n or len(tension) not in (0, n):
            return f"{len(displacement)} displacements and {len(tension)} tensions for {n} cables"
        if not all(map(math.isfinite, displacement)) or not all(map(math.isfinite, tension)):
            return "it contains a value that is not a number"
        low, high = drive.displacement_min, drive.displacement_max
        for motor, x in zip(self._hardware.motors, displacement):
            if not low - _MARGIN <= x <= high + _MARGIN:
                return f"{motor.cable} to {1e3 * x:.2f} mm; allowed: {1e3 * low:g} to {1e3 * high:g} mm"
        if not -0.1 <= age <= watchdog.command_timeout:
            return f"its IMU sample is older than {1e3 * watchdog.command_timeout:.0f} ms, or of the future"
        seen, self._last_seen = self._last_seen, list(displacement)
        seen_time, self._last_seen_time = self._last_seen_time, now
        if seen is not None and now - seen_time < watchdog.command_timeout:
            jump = max(abs(x - y) for x, y in zip(displacement, seen))
            if jump > watchdog.command_jump:
                return f"it jumps by {1e3 * jump:.1f} mm; allowed: {1e3 * watchdog.command_jump:g} mm"
        if self._require_imu and now - self._imu_time > watchdog.imu_timeout:
            return "there are no good IMU samples"
        return None

    def _missing(self, now: float) -> str | None:
        """Which motors do not answer, in one sentence."""
        limit = self._hardware.watchdog.feedback_timeout
        silent = [
            self._name(motor)
            for motor, encoder in zip(self._hardware.motors, self._encoders)
            if encoder.count is None or now - encoder.time > limit
        ]
        if not silent:
            return None
        if len(silent) == len(self._encoders):
            return "no motor answers: are the C610 powered, and is the bus connected?"
        return f"no feedback from {', '.join(silent)}"

    def _name(self, motor: object) -> str:
        return f"motor {motor.can_id} ({motor.cable})"

    def _sense(self, index: int) -> int:
        return self._hardware.motors[index].direction

    def _displacements(self) -> list[float]:
        travel = self._hardware.drive.travel_per_count
        return [
            0.0 if encoder.count is None or zero is None else self._sense(i) * (encoder.count - zero) * travel + motor.offset
            for i, (encoder, zero, motor) in enumerate(zip(self._encoders, self._zeros, self._hardware.motors))
        ]

    def _velocities(self) -> list[float]:
        per_rpm = 8192 / 60 * self._hardware.drive.travel_per_count
        return [self._sense(i) * encoder.speed * per_rpm for i, encoder in enumerate(self._encoders)]
