"""The inverse problem in the closed loop, on a small robot of constant-curvature segments (arc_robot).

The loop is that of the graph: linear response -> programme -> displacements -> one Newton step of the model -> response.
"""

import dataclasses

import arc_robot
import numpy as np
import pytest
from arc_robot import LENGTH, LIMITS, STATIONS, ArcRobot, closed_loop, controller, effector

from gravcomp.description import Limits
from gravcomp.inverse import (
    ControllerCode,
    InverseOptions,
    Target,
    bend_target,
    straight_target,
)

GRAVITY = 9.81


def directions(count, seed=0):
    vectors = np.random.default_rng(seed).normal(size=(count, 3))
    return GRAVITY * vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def tip_errors(robot):
    e = effector(robot.q)
    return np.linalg.norm(e[:2]), np.degrees(np.arccos(min(1.0, e[5])))


@pytest.mark.parametrize("gravity", directions(4))
def test_straight_robot_is_held_against_gravity_from_any_direction(gravity):
    robot, _, command = closed_loop([gravity] * 80, straight_target(LENGTH))
    assert tip_errors(robot)[0] < 0.05e-3
    assert command.code == ControllerCode.OK


def test_direction_weight_takes_the_tilt_away():
    target = straight_target(LENGTH, tip_direction_weight=1e-3)
    robot, _, _ = closed_loop(directions(1) * np.ones((80, 1)), target)
    lateral, tilt = tip_errors(robot)
    assert lateral < 0.15e-3 and tilt < 0.3


@pytest.mark.parametrize("gravity", directions(3, seed=4))
def test_cables_of_a_segment_do_not_pull_against_each_other(gravity):
    robot, _, _ = closed_loop([gravity] * 80, straight_target(LENGTH, tip_direction_weight=1e-3))
    assert robot.tension[:3].min() < 1e-3 and robot.tension[3:].min() < 1e-3


def test_bent_shape_is_reached_and_kept_while_gravity_turns():
    target = bend_target(LENGTH, np.radians(60), np.radians(30))
    angles = np.linspace(0.0, np.pi / 2, 160)
    turning = GRAVITY * np.stack([-np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    robot, _, command = closed_loop(np.vstack([turning, [turning[-1]] * 20]), target)
    across = effector(robot.q)[:3] - target.tip_position
    across -= across @ target.tip_direction * target.tip_direction
    assert np.linalg.norm(across) < 0.1e-3
    assert command.code == ControllerCode.OK


def test_backbone_weight_straightens_the_middle():
    gravities = [np.array([-GRAVITY, 0.0, 0.0])] * 80
    middle = slice(6 + 3 * 4, 6 + 3 * 4 + 2)
    tip_alone, _, _ = closed_loop(gravities, straight_target(LENGTH))
    with_middle, _, _ = closed_loop(gravities, straight_target(LENGTH, backbone_station=[0.5], backbone_weight=[1.0]))
    assert np.linalg.norm(effector(with_middle.q)[middle]) < 0.2 * np.linalg.norm(effector(tip_alone.q)[middle])


@pytest.mark.parametrize(
    "target", [Target(np.array([0.06, 0.03, 0.12])), Target(np.array([-0.15, 0.0, 0.0])), bend_target(LENGTH, 5.0, 0.3)]
)
def test_infeasible_target_settles_at_the_nearest_shape_and_says_so(target):
    limits = dataclasses.replace(LIMITS, tension_max=2.0)
    robot, displacements, command = closed_loop([np.array([-GRAVITY, 0.0, 0.0])] * 300, target, controller(limits=limits))
    assert np.abs(np.diff(displacements[-40:], axis=0)).max() < 2e-6
    assert command.code == ControllerCode.UNREACHABLE
    distance = np.linalg.norm(effector(robot.q)[:3] - target.tip_position)
    assert command.distance == pytest.approx(distance, rel=0.02)
    assert f"{1e3 * command.distance:.1f} mm" in command.message


def test_limits_and_rates_are_never_left():
    limits = Limits(tension_max=0.3, displacement_min=-1e-3, displacement_max=1e-3, displacement_rate=0.02)
    control = controller(limits=limits)
    gravities = np.repeat(directions(6, seed=2), 30, axis=0)
    _, displacements, command = closed_loop(gravities, bend_target(LENGTH, 1.0, 0.0), control)
    assert np.abs(displacements).max() <= 1e-3
    assert np.abs(np.diff(displacements, axis=0)).max() <= 0.02 * 0.01 + 1e-12
    assert command.tension.max() <= 0.3
    assert command.code in (ControllerCode.AT_LIMIT, ControllerCode.UNREACHABLE) and "s" in command.message


def test_rate_limit_is_named_while_moving():
    slow = dataclasses.replace(LIMITS, displacement_rate=0.002)
    _, _, command = closed_loop([np.array([-GRAVITY, 0.0, 0.0])] * 4, straight_target(LENGTH), controller(limits=slow))
    assert command.code == ControllerCode.AT_LIMIT
    assert "displacement rate" in command.message


def test_slack_is_entered_and_left_without_chatter():
    # A turn and a quarter about the robot's axis, 90 deg/s: each cable becomes idle and taut again several times a turn.
    angles = np.linspace(0.0, 2.5 * np.pi, 500)
    turning = GRAVITY * np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    _, displacements, _ = closed_loop(turning, straight_target(LENGTH))
    velocity = np.diff(displacements[100:], axis=0)
    back_and_forth = (velocity[2:] * velocity[1:-1] < 0.0) & (velocity[1:-1] * velocity[:-2] < 0.0)
    assert not back_and_forth.any()
    # A jump by the slack of 0.1 mm would show: the motion itself makes 17 um a step at most.
    assert np.abs(velocity).max() < 0.03e-3


def test_no_drift_under_constant_gravity():
    _, displacements, _ = closed_loop([np.array([-7.0, 3.0, -6.0])] * 300, straight_target(LENGTH))
    assert np.abs(displacements[-1] - displacements[-150]).max() < 1e-7


def test_pretension_keeps_every_cable_taut():
    control = controller(InverseOptions(pretension=0.02))
    robot, _, _ = closed_loop([np.array([-GRAVITY, 0.0, 0.0])] * 80, straight_target(LENGTH), control)
    assert robot.tension.min() > 0.019


def test_same_inputs_give_the_same_bits():
    gravities = np.repeat(directions(3, seed=7), 20, axis=0)
    first = closed_loop(gravities, straight_target(LENGTH))[1]
    second = closed_loop(gravities, straight_target(LENGTH))[1]
    assert np.array_equal(first, second)


def test_broken_answer_keeps_the_last_command_and_recovers():
    robot, control, gravity = ArcRobot(), controller(), np.array([-GRAVITY, 0.0, 0.0])
    response = robot.step(gravity, None, iterations=10)
    good = control.step(response, straight_target(LENGTH), backbone_station=STATIONS, tension=robot.tension)
    response.effector_free = response.effector_free * np.nan
    broken = control.step(response, straight_target(LENGTH), backbone_station=STATIONS, tension=robot.tension)
    assert broken.code == ControllerCode.SOLVER_FAILED
    assert np.array_equal(broken.displacement, good.displacement)
    again = control.step(robot.response(gravity), straight_target(LENGTH), backbone_station=STATIONS, tension=robot.tension)
    assert again.code != ControllerCode.SOLVER_FAILED


def test_relaxing_pays_the_cables_out_at_the_allowed_rate():
    robot, control, gravity = ArcRobot(), controller(), np.array([-GRAVITY, 0.0, 0.0])
    closed_loop([gravity] * 60, straight_target(LENGTH), control, robot)
    displacements = []
    for _ in range(60):
        command = control.relax(robot.response(gravity))
        displacements.append(command.displacement)
        robot.step(gravity, command.displacement)
    assert command.code == ControllerCode.RELAXING
    assert np.abs(np.diff(displacements, axis=0)).max() <= 0.05 * 0.01 + 1e-12
    assert robot.tension.max() == 0.0


def test_codes_are_those_of_the_message():
    names = {code.name: code.value for code in ControllerCode}
    message = (arc_robot_root() / "gravcomp_msgs" / "msg" / "ControllerStatus.msg").read_text(encoding="utf-8")
    lines = [line.split("#")[0].removeprefix("uint8 ") for line in message.splitlines()]
    constants = dict(line.split("=") for line in lines if "=" in line)
    assert {k.strip(): int(v) for k, v in constants.items()} == names


def arc_robot_root():
    from pathlib import Path

    return Path(arc_robot.__file__).resolve().parents[2]
