"""Measured state of joints that wind cables, from messages such as sensor_msgs/JointState.

A message may hold any joints in any order, those of an arm as well, and a robot may send its joints in several messages.
Velocities and efforts may be missing: velocities are then differences of positions, and forces are unknown. A state is as old as
its stamp says (`stamp_lateness`): messages that have waited in a queue do not count as new because they arrive now.
"""

import dataclasses
import math
from collections.abc import Sequence

from gravcomp.description.hardware import Drive, Watchdog
from gravcomp.description.joint_motors import JointMotor
from gravcomp.motors.joint_scale import JointScale
from gravcomp.motors.stamp_lateness import StampLateness

_JUMPS = 3  # messages in a row at the other side of a jump, after which the joint counts as being there
_NAMES_SHOWN = 8


@dataclasses.dataclass
class _Measured:
    """Last state of one joint: rad, rad/s, N m; arrival and measurement in s (monotonic); stamp in ns (the sender's clock)."""

    angle: float = 0.0
    speed: float = 0.0
    effort: float | None = None
    arrival: float = -math.inf
    time: float = -math.inf
    stamp: int = 0
    jumps: int = 0
    jumped: bool = False
    lateness: StampLateness = dataclasses.field(default_factory=StampLateness)


class JointStates:
    """The joints of `motors` (k). Attributes: scales (k), rejected (messages or values that were not usable)."""

    def __init__(self, motors: Sequence[JointMotor], drive: Drive, watchdog: Watchdog):
        self.motors, self.rejected = tuple(motors), 0
        self.scales = [JointScale(motor, drive) for motor in self.motors]
        self._index = {motor.joint: i for i, motor in enumerate(self.motors)}
        self._watchdog = watchdog
        self._measured = [_Measured() for _ in self.motors]
        self._others: dict[str, float] = {}  # names of joints without a cable, with the time of their last message

    def forget_clocks(self) -> None:
        """Forget the stamps and the lateness of messages so far: the host's clock has been set."""
        for measured in self._measured:
            measured.stamp = 0
            measured.lateness.reset()

    def on_message(
        self,
        names: Sequence[str],
        angles: Sequence[float],
        speeds: Sequence[float],
        efforts: Sequence[float],
        now: float,
        stamp: int = 0,
        wall: float | None = None,
    ) -> None:
        """Take a message: names, and angles (rad), speeds (rad/s), efforts (N m) of all of them; speeds and efforts may be empty.

        `stamp` (ns, the sender's clock) is that of the message, 0 for none; `wall` (s) is now on the host's clock, None: `now`
        is. A message older than the last one is not used.
        After a silence longer than `zero_timeout` the zero position of a joint that has none in the robot file is lost.
        """
        if len(angles) != len(names):
            self.rejected += 1
            return
        with_speed, with_effort = len(speeds) == len(names), len(efforts) == len(names)
        for k, name in enumerate(names):
            index = self._index.get(name)
            if index is None:
                if len(self._others) >= _NAMES_SHOWN and name not in self._others:
                    self._others.pop(min(self._others, key=self._others.__getitem__))
                self._others[name] = now
                continue
            effort = efforts[k] if with_effort and math.isfinite(efforts[k]) else None
            self._take(index, angles[k], speeds[k] if with_speed else math.nan, effort, now, stamp, wall)

    def _take(
        self, index: int, angle: float, speed: float, effort: float | None, now: float, stamp: int, wall: float | None
    ) -> None:
        last, scale = self._measured[index], self.scales[index]
        silence = now - last.arrival
        silent = silence > self._watchdog.feedback_timeout
        if not math.isfinite(angle) or (stamp and stamp <= last.stamp and not silent):
            self.rejected += 1
            return
        if stamp < last.stamp:  # another clock
            last.lateness.reset()
        measured = now - (last.lateness.of(now, (now if wall is None else wall) - 1e-9 * stamp) if stamp else 0.0)
        since = measured - last.time
        # Over a silence the joint may have gone far; otherwise a distance that the watchdog calls a runaway is no motion.
        way = abs(angle - last.angle) * scale.drive.capstan_radius
        if self._watchdog.zero_timeout < silence < math.inf and self.motors[index].zero is None:
            scale.zero = None
        elif way > self._watchdog.following_error and (not silent or last.jumps):
            last.jumps += 1
            self.rejected += 1
            if last.jumps < _JUMPS:
                return
            last.jumped, speed = True, 0.0
        if not math.isfinite(speed):
            speed = 0.0 if silent or since <= 0.0 else (angle - last.angle) / since
        last.angle, last.speed, last.effort, last.jumps = angle, speed, effort, 0
        last.arrival, last.time, last.stamp = now, measured, stamp

    @property
    def zeros_known(self) -> bool:
        """Whether every zero position is known."""
        return all(scale.zero is not None for scale in self.scales)

    def fill_zeros(self) -> None:
        """Set every unknown zero position to the joint's present angle."""
        for scale, measured in zip(self.scales, self._measured):
            if scale.zero is None:
                scale.zero = measured.angle

    def times(self) -> list[float]:
        """Time (s) at which the last state of each joint was measured."""
        return [measured.time for measured in self._measured]

    def displacement(self) -> list[float]:
        """Displacements (k,) in m at the capstans."""
        return [scale.displacement(measured.angle) for scale, measured in zip(self.scales, self._measured)]

    def velocity(self) -> list[float]:
        """Velocities (k,) in m/s at the capstans."""
        return [
            motor.direction * measured.speed * scale.radius(measured.angle)
            for motor, scale, measured in zip(self.motors, self.scales, self._measured)
        ]

    def force(self) -> list[float | None]:
        """Forces (k,) in N at the capstans, without friction; None for a joint without effort."""
        return [
            None if measured.effort is None else motor.direction * measured.effort / scale.radius(measured.angle)
            for motor, scale, measured in zip(self.motors, self.scales, self._measured)
        ]

    def effort(self, index: int, force: float) -> float:
        """Return the effort (N m) of a joint that makes a force (N) at its capstan."""
        motor, scale = self.motors[index], self.scales[index]
        return motor.direction * force * scale.radius(self._measured[index].angle)

    def missing(self, now: float) -> str | None:
        """Joints that do not answer, in words."""
        limit = self._watchdog.feedback_timeout
        silent = [motor for motor, measured in zip(self.motors, self._measured) if now - measured.time > limit]
        if not silent:
            return None
        late = max(now - measured.time for measured in self._measured)
        if all(now - measured.arrival <= limit for measured in self._measured):
            return f"joint_states arrives {1e3 * late:.0f} ms late"
        foreign = ", ".join(name for name, seen in self._others.items() if now - seen <= limit)
        there = f"; it has other joints: {foreign}" if foreign else ""
        if len(silent) == len(self.motors):
            what = "these joints" if foreign else "any message"
            return f"joint_states does not bring {what}: {', '.join(motor.joint for motor in silent)}{there}"
        return f"joint_states does not bring {', '.join(motor.label for motor in silent)}{there}"

    def jumped(self) -> str | None:
        """Joint whose angle has jumped."""
        for motor, measured in zip(self.motors, self._measured):
            if measured.jumped:
                return f"{motor.label}: its angle has jumped; has the motor been started again, or do two nodes publish it?"
        return None

    def clear_jumps(self) -> None:
        """Take all angles as they are."""
        for measured in self._measured:
            measured.jumps, measured.jumped = 0, False
