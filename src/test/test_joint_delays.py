"""joint_bridge with a controller of efforts when joint states come late and control periods are missed: no joint runs away."""

import collections
import dataclasses
import math
import random

import pytest
from motor_bench import STEP, SpringMotor

from gravcomp.bench.joint_campaign import with_joints
from gravcomp.description.hardware import Hardware, Motor
from gravcomp.motors.joint_bridge import JointBridge
from gravcomp.motors.joint_states import JointStates
from gravcomp.motors.loop_delay import NOMINAL, LoopDelay
from gravcomp.motors.stamp_lateness import WINDOW, StampLateness
from gravcomp.motors.state import State

HARDWARE = Hardware(motors=tuple(Motor(name, i + 1) for i, name in enumerate("abc")))
PERIOD = 0.004
AMPLITUDE = 0.004  # m
STIFFNESS, TAUT = 2000.0, 0.002  # N/m, m, of the springs


class Bench:
    """A bridge and geared motors on springs. The forward command controller keeps the last efforts.

    late(): s by which the next joint states arrive late; pause(): s by which the next control period is longer.
    """

    def __init__(self, friction: float, late=lambda: 0.0, pause=lambda: 0.0):
        hardware = with_joints(HARDWARE, "effort")
        motors = tuple(dataclasses.replace(motor, direction=1, zero=0.0) for motor in hardware.joints.motors)
        self.hardware = dataclasses.replace(hardware, joints=dataclasses.replace(hardware.joints, motors=motors))
        self.names = [motor.joint for motor in motors]
        self.late, self.pause = late, pause
        self.now = self.begin = 10.0
        self.bridge = JointBridge(self.hardware)
        self.bridge.configure()
        self.bridge.activate(self.now)
        self.motors = [SpringMotor(m, HARDWARE.drive, friction=friction, stiffness=STIFFNESS, taut=TAUT) for m in HARDWARE.motors]
        for motor in self.motors:
            motor.start = motor.angle = 0.0
        self.queue = collections.deque()
        self.next_state = self.next_tick = self.now
        self.states, self.latched, self.fastest, self.errors = collections.Counter(), "", 0.0, []

    def run(self, duration: float) -> "Bench":
        drive = self.hardware.drive
        for _ in range(round(duration / STEP)):
            self.now += STEP
            for motor in self.motors:
                motor.step()
            self.fastest = max(self.fastest, *(abs(motor.speed) * drive.capstan_radius for motor in self.motors))
            if self.now >= self.next_state:
                self.next_state += PERIOD
                arrival = max(self.now + self.late(), self.queue[-1][0] if self.queue else 0.0)  # a queue keeps its order
                self.queue.append((arrival, self.now, [m.angle for m in self.motors], [m.speed for m in self.motors]))
            if self.now >= self.next_tick:
                self.next_tick = self.now + PERIOD + self.pause()
                self.tick()
        return self

    def tick(self) -> None:
        while self.queue and self.queue[0][0] <= self.now:
            _, measured, angles, speeds = self.queue.popleft()
            self.bridge.on_joint_states(self.names, angles, speeds, [], self.now, round(1e9 * measured))
        goal = [AMPLITUDE * math.sin(self.now), AMPLITUDE, -0.5 * AMPLITUDE * math.sin(2.0 * self.now)]
        self.bridge.command(goal, [max(0.0, STIFFNESS * (x - TAUT)) for x in goal], self.now)
        efforts = self.bridge.tick(self.now)
        if efforts is not None:
            for motor, effort in zip(self.motors, efforts):
                motor.current = effort / self.hardware.drive.torque_constant
        self.states[self.bridge.state] += 1
        if self.bridge.state is State.FAULT and "resume" in self.bridge.message:
            self.latched = self.bridge.message
        if self.bridge.state is State.ACTIVE and self.now > self.begin + 2.0:
            self.errors.append(max(abs(x - motor.displacement) for x, motor in zip(goal, self.motors)))


@pytest.fixture(autouse=True)
def chance():
    return random.seed(1)


CASES = {
    "states late by a queue that changes": (lambda: random.uniform(0.0, 0.08), lambda: 0.0),
    "states always late": (lambda: 0.06, lambda: 0.0),
    "some periods missed": (lambda: 0.0, lambda: random.choice([0.0] * 9 + [random.uniform(0.0, 0.09)])),
    "a rare period missed": (lambda: 0.0, lambda: 0.09 if random.random() < 0.003 else 0.0),
    "all periods long": (lambda: 0.0, lambda: random.uniform(0.0, 0.09)),
    "both": (lambda: random.uniform(0.0, 0.09), lambda: random.uniform(0.0, 0.09)),
}


@pytest.mark.parametrize("friction", [0.02, 0.1])
@pytest.mark.parametrize("case", CASES)
def test_no_joint_runs_away_when_states_and_periods_are_late(case, friction):
    late, pause = CASES[case]
    bench = Bench(friction, late, pause).run(4.0)
    assert bench.fastest < HARDWARE.drive.velocity_limit
    assert bench.latched == "" and bench.states[State.ACTIVE] > 0.5 * sum(bench.states.values())


def test_a_loop_in_time_is_as_stiff_as_on_a_bus():
    bench = Bench(0.1).run(4.0)
    assert bench.bridge.loop_delay == pytest.approx(NOMINAL, abs=1e-3)
    assert max(bench.errors) < 0.02 * AMPLITUDE


def test_states_that_are_too_late_end_the_efforts():
    bench = Bench(0.1).run(1.0)
    assert bench.bridge.state is State.ACTIVE
    bench.late = lambda: 0.3
    bench.run(0.5)
    bench.late = lambda: 0.0
    assert bench.bridge.state is State.FAULT and all(motor.current == 0.0 for motor in bench.motors)
    assert bench.run(1.5).bridge.state is State.ACTIVE


def test_messages_from_a_queue_are_named_late():
    joints = JointStates(with_joints(HARDWARE, "effort").joints.motors, HARDWARE.drive, HARDWARE.watchdog)
    names = ["motor_1", "motor_2", "motor_3"]
    for k in range(100):
        joints.on_message(names, [0.0] * 3, [], [], 5.0 + 0.006 * k, round(1e9 * (5.0 + 0.004 * k)))
    assert joints.missing(5.0 + 0.006 * 99) == "joint_states arrives 198 ms late"


def test_lateness_needs_no_common_clock():
    lateness = StampLateness()
    ahead = [lateness.of(0.01 * k, -500.0 + 0.002 * (k % 5)) for k in range(10)]
    assert ahead == pytest.approx([0.0, 0.002, 0.004, 0.006, 0.008] * 2)
    assert StampLateness().of(0.0, 0.05) == 0.05  # by the same clock
    assert lateness.of(1.0, -499.0) == pytest.approx(1.0)
    assert lateness.of(1.1 + WINDOW, -499.0) == pytest.approx(1.0)
    assert lateness.of(1.2 + 2 * WINDOW, -499.0) == 0.0  # the clock was set


def test_the_delay_of_a_loop_rises_at_once_and_falls_slowly():
    delay, now = LoopDelay(None), 0.0
    for _ in range(1000):
        now += 0.004
        softness = delay.update(now, now)
    assert softness == 1.0
    now += 0.06
    assert delay.update(now, now - 0.03) == pytest.approx(NOMINAL / 0.09)
    assert delay.update(now + 0.004, now + 0.004) < 0.1
    assert LoopDelay(0.03).update(0.0, 0.0) == pytest.approx(NOMINAL / 0.03)
