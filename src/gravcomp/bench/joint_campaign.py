"""Hostile messages to a JointBridge in virtual time, and a check of what it sends that shares no code with it.

Good messages of mock joints and of a controller alternate with bursts of malformed ones on every input: joint states of other
joints, of wrong sizes, not finite, of far away, out of order; commands of every kind; requests; a controller that vanishes; a
clock that stops or jumps. Violations are

    output in a state in which nothing may be sent; not finite; beyond the limits of a joint; an effort beyond the current limit;
    an angle that moves faster than the velocity limit allows, from the last one or from where the joint is said to be
"""

import dataclasses
import math
import random
from collections.abc import Callable

from gravcomp.description.hardware import Hardware
from gravcomp.description.joint_motors import COMMANDS, JointMotor, Joints
from gravcomp.motors.joint_bridge import JointBridge
from gravcomp.motors.state import DRIVING, State

_WILD = (math.nan, math.inf, -math.inf, 1e308, -1e308, 1e-308, 0.0, -1.0, 1.0, 0.03, 1e9)
_BURST = 20  # hostile messages in a row, at most
_GOOD = 60  # good periods in a row, at most
_PERIOD = 0.01  # s
_ZERO = 0.3  # rad, of the joint next to the first one, and so on
_SLACK = 1e-9


@dataclasses.dataclass
class Tally:
    """Counts of a campaign. largest: share of the velocity limit, of the fastest angle."""

    messages: int = 0
    outputs: int = 0
    active: int = 0
    violations: int = 0
    latched: int = 0
    largest: float = 0.0


def with_joints(hardware: Hardware, command: str) -> Hardware:
    """Return the hardware with a joint for each motor, turned in either direction, with zero positions of their own."""
    motors = tuple(
        JointMotor(
            **{field: getattr(motor, field) for field in ("cable", "ratio", "pair", "also", "preload", "differential")},
            joint=f"motor_{i + 1}",
            direction=1 if i % 2 else -1,
            zero=_ZERO * i,
        )
        for i, motor in enumerate(hardware.motors)
    )
    return dataclasses.replace(hardware, joints=Joints(controller="cable_controller", motors=motors, command=command))


def run(hardware: Hardware, messages: int, seed: int, progress: Callable[[str], None] = lambda _: None) -> dict[str, Tally]:
    """Send about `messages` hostile messages to a bridge of each kind of controller. Return the tallies by kind."""
    result = {}
    for command in COMMANDS:
        progress(f"hostile messages, command: {command}")
        result[command] = _Attack(with_joints(hardware, command), random.Random(seed)).run(-(-messages // len(COMMANDS)))
    return result


class _Attack:
    """One bridge under attack. The joints are where their commands are, within a dead band of their friction."""

    def __init__(self, hardware: Hardware, chance: random.Random):
        assert hardware.joints is not None
        self._chance, self._drive, self._motors = chance, hardware.drive, hardware.joints.motors
        self._by_effort = hardware.joints.command == "effort"
        self._bridge = JointBridge(hardware)
        self._cables, self._names = len(hardware.cables), [motor.joint for motor in self._motors]
        self._now, self._stamp = 1.0, 10**9
        self._angles = [motor.zero or 0.0 for motor in self._motors]
        self._last: list[float] | None = None
        self._last_time = 0.0
        self._goal = [0.0] * self._cables
        self._tally = Tally()

    def run(self, messages: int) -> Tally:
        bridge, chance, tally = self._bridge, self._chance, self._tally
        bridge.configure()
        bridge.activate(self._now)
        while tally.messages < messages:
            for _ in range(chance.randrange(_GOOD)):
                self._good()
            for _ in range(chance.randrange(1, _BURST)):
                self._hostile()
                self._tick(chance.choice((0.0, 1e-4, 1e-3, 0.01)))
            if bridge.state in (State.STOPPED, State.INACTIVE) or "~/resume" in bridge.message:
                tally.latched += bridge.state is State.FAULT
                bridge.controller(None)
                bridge.activate(self._now)
                self._last = None
        return tally

    def _good(self) -> None:
        """One period of a good robot and controller, which moves slowly."""
        self._bridge.controller(None)
        self._bridge.on_joint_states(self._names, self._angles, [], [], self._now, self._stamp)
        self._goal = [min(max(x + self._chance.uniform(-2e-4, 2e-4), 0.0), 0.01) for x in self._goal]
        self._bridge.command(self._goal, [], self._now)
        self._tick(_PERIOD)
        self._tally.active += self._bridge.state is State.ACTIVE

    def _hostile(self) -> None:
        chance, bridge = self._chance, self._bridge
        self._tally.messages += 1
        kind = chance.randrange(10)
        if kind < 4:
            count = chance.choice((0, 1, len(self._names), len(self._names), 30))
            names = [chance.choice((*self._names, "arm_1", "", "x" * 300)) for _ in range(count)]
            if chance.random() < 0.5:
                names = chance.sample(self._names, len(self._names))
            sizes = [len(names) if chance.random() < 0.7 else chance.randrange(9) for _ in range(3)]
            stamp = chance.choice((0, 1, self._stamp, self._stamp + 1, self._stamp + 10**15, -5))
            angles, speeds, efforts = ([self._value() for _ in range(size)] for size in sizes)
            bridge.on_joint_states(names, angles, speeds, efforts, self._now, stamp)
        elif kind < 8:
            size = self._cables if chance.random() < 0.7 else chance.randrange(9)
            tension = [self._value() for _ in range(chance.choice((0, 0, self._cables, 3)))]
            bridge.command([self._value() for _ in range(size)], tension, self._now, age=chance.choice((0.0, 0.1, *_WILD)))
        elif kind == 8:
            chance.choice((bridge.stop, lambda: bridge.release(self._now), lambda: bridge.resume(self._now)))()
        else:
            bridge.controller(chance.choice((None, "nobody takes the commands")))

    def _value(self) -> float:
        """A wild value, or one that a joint or a cable could have."""
        chance = self._chance
        if chance.random() < 0.5:
            return chance.choice(_WILD)
        return chance.choice((chance.uniform(-0.04, 0.04), chance.choice(self._angles) + chance.gauss(0.0, 0.3)))

    def _tick(self, dt: float) -> None:
        if self._chance.random() < 0.01:
            dt = self._chance.choice((-0.5, 0.05, 0.2, 2.0))
        self._now += dt
        self._stamp += 1 + round(1e9 * max(dt, 0.0))  # the robot's clock does not jump
        output = self._bridge.tick(self._now)
        if output is None:
            return
        self._tally.outputs += 1
        self._tally.violations += not self._allowed(output)
        self._last, self._last_time = list(output), self._now
        if not self._by_effort:
            self._angles = list(output)

    def _allowed(self, output: list[float]) -> bool:
        state, drive = self._bridge.state, self._drive
        if state in (State.UNCONFIGURED, State.INACTIVE) or not all(map(math.isfinite, output)):
            return False
        if self._by_effort:
            largest = drive.current_limit * drive.torque_constant + _SLACK
            return max(map(abs, output)) <= (largest if state in DRIVING else 0.0)
        said = self._bridge.joints.displacement()
        turned = [_displacement(motor, drive.capstan_radius, angle) for motor, angle in zip(self._motors, output)]
        if not all(drive.displacement_min - _SLACK <= x <= drive.displacement_max + _SLACK for x in turned):
            return False
        if self._last is None:
            return True
        # No period counts for more than 20 ms, and one whose clock went back for nothing.
        room = drive.velocity_limit * min(max(self._now - self._last_time, 0.0), 0.02) + _SLACK
        before = [_displacement(motor, drive.capstan_radius, angle) for motor, angle in zip(self._motors, self._last)]
        ways = [abs(x - y) for x, y in zip(turned, before)]
        if max(ways) <= room:
            self._tally.largest = max(self._tally.largest, max(ways) / room)
            return True
        low, high = drive.displacement_min, drive.displacement_max
        return all(abs(x - min(max(y, low), high)) <= room for x, y in zip(turned, said))


def _displacement(motor: JointMotor, radius: float, angle: float) -> float:
    """Displacement (m) at the capstan for an angle (rad), by the formula of the description."""
    return radius * motor.direction * (angle - (motor.zero or 0.0)) + motor.offset
