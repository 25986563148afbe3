"""What a calibration finds of the IMU: its mount, and the bias of its accelerometer at the temperature that it has in use."""

import dataclasses

import numpy as np
import pytest

from gravcomp.calibration.fit import fit_statics
from gravcomp.calibration.force_length import implausible_length, length_rows
from gravcomp.calibration.measured import Measured, StillWindows
from gravcomp.calibration.moving import moving
from gravcomp.calibration.parameters import StaticParameters
from gravcomp.calibration.plan import Plan, PlannedPose, gravity_of
from gravcomp.calibration.standstill import Standstill
from gravcomp.calibration.statics import StaticPredictor
from gravcomp.calibration.unknowns import Priors, Unknown
from gravcomp.closed_loop.setup import Setup
from gravcomp.description import Elements, Material, Robot, Segment, load_robot_file
from gravcomp.trials.calibration_run import run_plan
from gravcomp.trials.resting_imu import gravity_at_rest
from gravcomp.virtual.motion import base_orientation

MOUNT, BIAS = np.radians([0.4, -0.5, 0.3]), np.array([0.06, -0.05, 0.04])  # rad; m/s^2


@pytest.fixture(scope="module")
def robot():
    material = Material(youngs_modulus=0.3e6, density=1100.0)
    segment = Segment("s", length=0.1, outer_diameter=0.01, lumen_diameter=0.004, material=material)
    return Robot("short", segments=(segment,), cables=(), elements=Elements(around=6, along=4, radial=1))


def orientations() -> np.ndarray:
    """Gravity (k, 3) with the axis horizontal and tilted, all around."""
    return np.array([gravity_of(np.radians(tilt), np.radians(roll)) for tilt in (0.0, 40.0, -40.0) for roll in range(0, 360, 90)])


def test_a_bias_of_the_accelerometer_is_not_taken_for_a_turned_mount(robot):
    """A turned mount bends the robot to the other side when it is turned about itself by half a turn; a bias does not."""
    measured, count = orientations()[[0, 1, 2, 3, 4, 9]], 6
    true = StaticParameters(np.array([0.3e6]), np.zeros(0), np.zeros(0), bias=BIAS, mount=MOUNT)
    empty = StillWindows(measured, np.zeros((count, 0)), np.zeros((count, 3)), np.zeros((count, 3)))
    tip = StaticPredictor(robot, empty).predict(true).tip
    windows = StillWindows(measured, empty.displacement, tip[:, :3], tip[:, 3:])
    fit = fit_statics(robot, windows, groups={"mount", "bias"})
    np.testing.assert_allclose(fit.parameters.bias, BIAS, atol=0.012)
    np.testing.assert_allclose(fit.parameters.mount, MOUNT, atol=np.radians(0.07))


def test_a_mount_does_not_stand_for_a_bias_that_two_orientations_do_not_tell(robot):
    measured = orientations()[[4, 5]]
    true = StaticParameters(np.array([0.3e6]), np.zeros(0), np.zeros(0), bias=BIAS)
    empty = StillWindows(measured, np.zeros((2, 0)), np.zeros((2, 3)), np.zeros((2, 3)))
    tip = StaticPredictor(robot, empty).predict(true).tip
    windows = StillWindows(measured, empty.displacement, tip[:, :3], tip[:, 3:])
    error = {}
    for groups in (("mount", "bias"), ("mount",)):
        found = fit_statics(robot, windows, groups=set(groups)).parameters.true_gravity(orientations())
        error[groups] = np.degrees(np.linalg.norm(found - true.true_gravity(orientations()), axis=1).max() / 9.81)
    assert error["mount", "bias"] < 0.75 * error["mount",]


def test_the_length_of_the_specific_force_tells_a_bias_from_a_turned_mount(robot):
    """In two opposite orientations, with scales that are wrong by their prior: along gravity, where no tip shows it."""
    measured = gravity_of(0.0, 0.0) * np.array([[1.0], [-1.0]])
    along = -measured / 9.80665
    force = 9.80665 * (1.0 + 0.003 * along[:, 0] ** 2) + along @ BIAS
    windows = StillWindows(measured, np.zeros((2, 0)), np.zeros((2, 3)), np.zeros((2, 3)), specific_force=force)
    bias = [Unknown("bias", (axis,), Priors().bias) for axis in range(3)]
    rows, expected = length_rows(windows, bias, np.eye(3), Priors())
    found = np.linalg.lstsq(np.vstack([rows, np.eye(3)]), np.append(expected, np.zeros(3)), rcond=None)[0] * Priors().bias
    assert found[0] == pytest.approx(BIAS[0], abs=2e-3) and np.abs(found[1:]).max() < 1e-12
    assert len(length_rows(dataclasses.replace(windows, specific_force=None), bias, np.eye(3), Priors())[0]) == 0
    wrong = dataclasses.replace(windows, specific_force=1.03 * force)  # of a chip as it comes from its maker
    assert "calibrate-imu" in implausible_length(wrong, Priors()) and not implausible_length(windows, Priors())
    assert len(length_rows(wrong, bias, np.eye(3), Priors())[0]) == 0
    # The fit has them: two orientations determine no bias by tips alone.
    tip = StaticPredictor(robot, windows).predict(StaticParameters(np.array([0.3e6]), np.zeros(0), np.zeros(0), bias=BIAS)).tip
    windows = dataclasses.replace(windows, tip_position=tip[:, :3], tip_direction=tip[:, 3:])
    fit = fit_statics(robot, windows, groups={"mount", "bias"})
    assert fit.parameters.bias[0] == pytest.approx(BIAS[0], abs=4e-3)


def test_gravity_keeps_its_length_and_loses_bias_and_turn():
    parameters = StaticParameters(np.array([1e6]), np.zeros(0), np.zeros(0), bias=BIAS, mount=np.array([0.0, 0.0, 0.5 * np.pi]))
    force = -orientations() + BIAS  # as an accelerometer reads it
    measured = -9.81 * force / np.linalg.norm(force, axis=1, keepdims=True)
    true = orientations() @ np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    np.testing.assert_allclose(parameters.true_gravity(measured) / 9.81, true / 9.80665, atol=1e-4)  # |f| is not g with a bias


def test_the_motion_is_predicted_with_the_gravity_of_the_fit():
    time = 0.01 * np.arange(200)
    tip = np.array([0.0, 0.0, 0.1]) + 0.02 * np.outer(np.sin(20.0 * time), [1.0, 0.0, 0.0])
    gravity = np.tile([-9.81, 0.0, 0.0], (200, 1))
    course = Measured("here", np.zeros(200, int), time, gravity, np.zeros((200, 0)), tip)
    file = load_robot_file("article")
    parameters = StaticParameters(np.array([1e6]), np.zeros(0), np.zeros(0), bias=BIAS, mount=MOUNT)
    (found,) = moving(course, parameters, Standstill.of(file.robot, 0.28))
    np.testing.assert_allclose(found.gravity, parameters.true_gravity(gravity)[: len(found.time)])


def test_the_imu_is_as_warm_as_in_use():
    """The accelerometer of this board changes by 0.08 g along each axis from the surroundings' temperature to that of use."""
    setup = Setup.of(load_robot_file("article"), 1)
    board = dataclasses.replace(setup.truth.board, accelerometer_drift=0.005, gyroscope_bias=0.0, gyroscope_drift=0.0)
    setup = dataclasses.replace(setup, truth=dataclasses.replace(setup.truth, board=board))
    released = np.full(len(setup.robot.cables), setup.robot.limits.displacement_min)
    pose = PlannedPose(0.0, 0.0, released, (), np.zeros(len(released)), np.zeros(3))
    measured = run_plan((setup, Plan((pose,), (0.5,), 0.5, 0.7)))
    assert 0.05 < np.abs(measured.specific_force[-5:].mean() - 9.80665) < 1.5  # as the IMU reads it, with its bias
    expected = gravity_at_rest(setup, base_orientation(0.0, 0.0))
    assert np.degrees(np.linalg.norm(measured.gravity[-5:].mean(axis=0) - expected) / 9.81) < 0.3
