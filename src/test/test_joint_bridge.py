"""joint_bridge without ROS: scales, joint states of every kind, states, what the controller is sent, hostile messages."""

import dataclasses
import math

import pytest

from gravcomp.bench.joint_campaign import run as attack
from gravcomp.bench.joint_campaign import with_joints
from gravcomp.config import ConfigError
from gravcomp.description.hardware import Drive, Hardware, Motor, Watchdog, parse_hardware
from gravcomp.description.joint_motors import COMMANDS, JointMotor, Lookup
from gravcomp.motors.joint_bridge import JointBridge
from gravcomp.motors.joint_guard import JointGuard
from gravcomp.motors.joint_output import JointOutput
from gravcomp.motors.joint_scale import JointScale
from gravcomp.motors.joint_states import JointStates
from gravcomp.motors.setpoint import Setpoint
from gravcomp.motors.state import State
from gravcomp.virtual.joint_controller import JointController, TrajectoryPoint

CABLES = ("a", "b", "c")
HARDWARE = Hardware(motors=tuple(Motor(name, i + 1) for i, name in enumerate(CABLES)))
PERIOD = 0.004
GOAL = [0.004, -0.003, 0.002]


class Bench:
    """A bridge and joints that are where they are commanded."""

    def __init__(self, command: str = "position", hardware: Hardware = HARDWARE, **changes):
        self.hardware = with_joints(hardware, command)
        motors = tuple(dataclasses.replace(motor, **changes) for motor in self.hardware.joints.motors)
        self.hardware = dataclasses.replace(self.hardware, joints=dataclasses.replace(self.hardware.joints, motors=motors))
        self.bridge, self.now, self.sent = JointBridge(self.hardware), 5.0, []
        self.names = [motor.joint for motor in motors]
        self.angles = [motor.zero or 0.0 for motor in motors]
        self.follows = self.answers = True
        self.bridge.configure()
        self.bridge.activate(self.now)

    def run(self, duration: float, command=GOAL) -> "Bench":
        for _ in range(round(duration / PERIOD)):
            self.now += PERIOD
            if self.answers:
                self.bridge.on_joint_states(self.names, self.angles, [], [], self.now)
            if command is not None:
                self.bridge.command(command, [], self.now)
            output = self.bridge.tick(self.now)
            if output is not None:
                self.sent.append(output)
                if self.follows and self.hardware.joints.command != "effort":
                    self.angles = list(output)
        return self

    def displacements(self) -> list[float]:
        radius = self.hardware.drive.capstan_radius
        motors = self.hardware.joints.motors
        return [m.direction * radius * (q - (m.zero or 0.0)) for m, q in zip(motors, self.angles)]


def test_the_joints_come_to_the_commanded_displacements():
    bench = Bench().run(1.0)
    assert bench.bridge.state is State.ACTIVE
    assert bench.displacements() == pytest.approx(GOAL, abs=1e-9)
    assert bench.bridge.snapshot().displacement == pytest.approx(GOAL, abs=1e-9)


def test_a_joint_without_a_zero_position_starts_at_zero_where_it_is():
    bench = Bench(zero=None)
    bench.angles = [1.0, -2.0, 3.0]
    bench.run(1.0)
    assert bench.angles == pytest.approx([1.0 - 0.8, -2.0 - 0.6, 3.0 - 0.4], abs=1e-9)  # directions -1, 1, -1; 5 mm


# Each: the cause, the state it leads to, words of the message.
CAUSES = {
    "stale command": (lambda b: b.run(0.3, None), State.HOLDING, "no command from an IMU sample of the last 200 ms"),
    "nan": (lambda b: b.run(0.02, [math.nan] * 3), State.HOLDING, "not a number"),
    "outside": (lambda b: b.run(0.02, [0.031] * 3), State.HOLDING, "allowed: -30 to 30 mm"),
    "jump": (lambda b: b.run(PERIOD, [0.02] * 3), State.HOLDING, "jumps by"),
    "no joint states": (lambda b: (setattr(b, "answers", False), b.run(0.2)), State.FAULT, "does not bring any message"),
    "controller gone": (lambda b: (b.bridge.controller("nobody takes it"), b.run(0.02)), State.FAULT, "nobody takes it"),
    "stop": (lambda b: (b.bridge.stop(), b.run(0.02)), State.STOPPED, "the controller keeps the joints"),
    "refusing": (lambda b: (setattr(b, "follows", False), b.run(1.2, [0.002, -0.003, 0.002])), State.FAULT, "take the commands"),
    "jumping": (lambda b: (b.angles.__setitem__(1, 4.0), setattr(b, "follows", False), b.run(0.02)), State.FAULT, "has jumped"),
}


@pytest.mark.parametrize("cause", CAUSES)
def test_every_cause_leads_to_its_state(cause):
    act, state, words = CAUSES[cause]
    bench = Bench().run(1.0)
    act(bench)
    assert bench.bridge.state is state and words in bench.bridge.message


def test_a_fault_of_the_feedback_ends_by_itself_and_a_jump_needs_resume():
    bench = Bench().run(0.5)
    bench.answers = False
    bench.run(0.2)
    bench.answers = True
    assert bench.run(0.5).bridge.state is State.ACTIVE
    bench.angles[0] += 3.0
    bench.follows = False
    bench.run(0.5)
    assert bench.bridge.state is State.FAULT
    bench.follows = True
    assert bench.bridge.resume(bench.now)[0]
    assert bench.run(0.5).bridge.state is State.ACTIVE


def test_release_pays_the_cables_out_and_stops():
    bench = Bench().run(0.5)
    bench.bridge.release(bench.now)
    bench.run(2.5)
    assert bench.bridge.state is State.STOPPED
    assert bench.displacements() == pytest.approx([HARDWARE.drive.displacement_min] * 3, abs=1e-9)
    sent = len(bench.sent)
    bench.run(0.1)
    assert len(bench.sent) == sent  # a controller of positions is left alone


def test_a_stopped_effort_controller_is_sent_zeros():
    bench = Bench("effort").run(0.4)
    assert bench.bridge.state is State.ACTIVE and any(any(values) for values in bench.sent)
    bench.bridge.stop()
    bench.run(PERIOD)
    assert bench.sent[-1] == [0.0] * 3 and bench.bridge.last() == [0.0] * 3


@pytest.mark.parametrize(
    "states",
    [
        (["x", "motor_3", "motor_1", "motor_2"], [9.0, 0.3, 0.1, 0.2], [], []),  # out of order, with joints of an arm
        (["motor_1", "motor_2", "motor_3"], [0.1, 0.2, 0.3], [], []),  # without velocity and effort
        (["motor_1", "motor_2", "motor_3"], [0.1, 0.2, 0.3], [0.0] * 3, [math.nan] * 3),
        (["motor_1", "motor_2", "motor_3"], [0.1, 0.2, 0.3], [0.0], [0.0]),  # arrays of other lengths
    ],
)
def test_joint_states_of_every_kind_are_read(states):
    joints = JointStates(with_joints(HARDWARE, "position").joints.motors, Drive(), Watchdog())
    joints.on_message(*states, 1.0)
    radius = Drive().capstan_radius
    assert joints.displacement() == pytest.approx([-0.1 * radius, (0.2 - 0.3) * radius, -(0.3 - 0.6) * radius])
    assert joints.force() == [None] * 3 and joints.velocity() == [0.0] * 3


def test_joint_states_of_other_joints_are_named():
    joints = JointStates(with_joints(HARDWARE, "position").joints.motors, Drive(), Watchdog())
    joints.on_message(["shoulder", "elbow"], [0.0, 0.0], [], [], 1.0)
    assert (
        joints.missing(1.0)
        == "joint_states does not bring these joints: motor_1, motor_2, motor_3; it has other joints: shoulder, elbow"
    )


def test_older_states_and_single_outliers_are_not_used():
    joints = JointStates(with_joints(HARDWARE, "position").joints.motors, Drive(), Watchdog())
    names = ["motor_1", "motor_2", "motor_3"]
    joints.on_message(names, [0.1, 0.2, 0.3], [], [], 1.0, 100)
    joints.on_message(names, [0.2, 0.3, 0.4], [], [], 1.01, 99)
    joints.on_message(names, [50.0, 0.2, 0.3], [], [], 1.02, 120)
    assert joints.displacement()[0] == pytest.approx(-0.1 * Drive().capstan_radius)
    assert joints.rejected == 4 and joints.jumped() is None


def test_a_lookup_is_inverted_and_bounds_the_displacement():
    table = Lookup((0.0, 1.0, 2.0), (0.0, 0.004, 0.006))
    scale = JointScale(JointMotor(cable="a", joint="j", direction=-1, lookup=table, zero=0.5, offset=0.001), Drive())
    for x in (0.0012, 0.0049, 0.0065):
        assert scale.displacement(scale.angle(x)) == pytest.approx(x)
    assert scale.displacement(0.5 - 1.5) == pytest.approx(0.005 + 0.001)
    assert scale.radius(0.5 - 1.5) == pytest.approx(0.002)
    assert scale.limits() == pytest.approx((0.001, 0.007))


@pytest.mark.parametrize("direction", [1, -1])
def test_the_limits_of_a_joints_angle_bound_the_displacement(direction):
    motor = JointMotor(cable="a", joint="j", direction=direction, zero=0.0, angle_min=-1.0, angle_max=2.0)
    low, high = JointScale(motor, Drive()).limits()
    radius = Drive().capstan_radius
    assert (low, high) == pytest.approx((-radius, 2 * radius) if direction == 1 else (-2 * radius, radius))


def test_a_pair_on_one_joint():
    hardware = Hardware(motors=(Motor("a", 1, pair="c"), Motor("b", 2)), order=("a", "b", "c"))
    bench = Bench(hardware=hardware).run(1.0, [0.003, 0.001, -0.003])
    assert bench.bridge.snapshot().displacement == pytest.approx([0.003, 0.001, -0.003], abs=1e-9)


def one_motor(**keys):
    return {"controller": "c", "motors": [{"cable": "a", "joint": "x", **keys}]}


MISTAKES = [
    ({"controller": "c", "motors": []}, "0 motors"),
    ({"motors": [{"cable": "a", "joint": "x"}]}, "key 'hardware.joints.controller' is missing"),
    ({"controller": "c", "command": "speed", "motors": []}, "one of trajectory, position, effort"),
    (
        {"controller": "c", "motors": [{"cable": "a", "joint": "x"}, {"cable": "b", "joint": "x"}]},
        "joint x is given to more than",
    ),
    (one_motor(), "wind the cables a; the robot has a, b, c"),
    (one_motor(capstan_radius_mm=5, lookup={"angle_deg": [0, 1], "displacement_mm": [0, 1]}), "allowed: one of them"),
    (one_motor(lookup={"angle_deg": [0, 1, 2], "displacement_mm": [0, 2, 1]}), "must increase"),
    (one_motor(lookup={"angle_deg": [0], "displacement_mm": [0]}), "needed: two or more"),
    (one_motor(angle_min_deg=5, angle_max_deg=5), "must be below angle_max_deg"),
    (one_motor(zero=5), "did you mean 'zero_deg'"),
]


@pytest.mark.parametrize(("joints", "words"), MISTAKES)
def test_a_wrong_section_is_named(joints, words):
    section = {"joints": joints, "motors": [{"cable": name, "can_id": i + 1} for i, name in enumerate(CABLES)]}
    with pytest.raises(ConfigError, match=r"robot\.yaml: .*joints") as error:
        parse_hardware(section, source="robot.yaml", cables=CABLES)
    assert words in str(error.value)


def test_the_stand_in_refuses_what_the_trajectory_controller_refuses():
    controller = JointController(["a", "b"], "trajectory")
    point = TrajectoryPoint([0.1, 0.2], [], 0.1)
    cases = [
        (["a"], [point], None, "not those of the controller"),
        (["a", "c"], [point], None, "not those of the controller"),
        (["a", "b"], [], None, "empty"),
        (["a", "b"], [dataclasses.replace(point, velocities=[0.0, 0.1])], None, "not zero"),
        (["a", "b"], [point], 1.0, "in the past"),
        (["a", "b"], [point, point], None, "strictly increasing"),
        (["a", "b"], [dataclasses.replace(point, positions=[0.1])], None, "1 positions for 2 joints"),
    ]
    for names, points, start, words in cases:
        assert words in controller.on_trajectory(names, points, start, 2.0, [0.0, 0.0])
    assert controller.wanted(2.0) is None and controller.refused == len(cases)


def test_the_stand_in_goes_to_the_points_of_a_trajectory():
    controller = JointController(["a", "b"], "trajectory")
    assert controller.on_trajectory(["b", "a"], [TrajectoryPoint([0.2, 0.1], [], 0.1)], None, 2.0, [0.0, 0.0]) is None
    assert controller.wanted(2.05) == pytest.approx([0.05, 0.1])
    assert controller.wanted(9.0) == [0.1, 0.2]
    controller.on_trajectory(["a", "b"], [TrajectoryPoint([0.5, 0.6], [], 0.0)], None, 9.0, [0.1, 0.2])
    assert controller.wanted(9.0) == [0.5, 0.6]


def test_the_guard_acts_when_the_bridge_is_blocked_or_killed():
    guard = JointGuard(0.0)
    guard.on_bytes(b"..", 0.05)
    assert not guard.acting(0.14) and guard.acting(0.16) and not guard.done(100.0)
    guard.on_bytes(b".", 0.2)
    assert not guard.acting(0.25)
    guard.on_bytes(b"", 0.3)
    assert guard.acting(0.3) and not guard.done(15.2) and guard.done(15.4)


def test_the_guard_ends_with_a_good_bye():
    guard = JointGuard(0.0)
    guard.on_bytes(b".q", 0.1)
    assert guard.done(0.1) and not guard.acting(9.0)


def test_hostile_messages_move_no_joint_beyond_its_limits():
    tallies = attack(HARDWARE, 3000, 1)
    assert set(tallies) == set(COMMANDS)
    for tally in tallies.values():
        assert tally.violations == 0
        assert tally.active > 300 and tally.outputs > 1500  # good periods are followed in between


@pytest.mark.parametrize("command", ["position", "effort"])
def test_the_check_of_the_campaign_finds_a_bridge_without_its_last_clamp(monkeypatch, command):
    monkeypatch.setattr(JointOutput, "clamp", lambda self, values: [1.5 * value for value in values])
    assert attack(HARDWARE, 300, 1)[command].violations > 0


def test_the_check_of_the_campaign_finds_setpoints_that_are_too_fast(monkeypatch):
    monkeypatch.setattr(Setpoint, "advance", lambda self, target, limit, dt: setattr(self, "position", target))
    assert attack(HARDWARE, 300, 1)["position"].violations > 0
