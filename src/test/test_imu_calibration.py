"""Calibration from poses at rest finds the values of simulated errors, and reports what the poses do not determine."""

import math

import numpy as np
import pytest

from gravcomp.orientation import quaternion as quat
from gravcomp.orientation.calibration import fit_accelerometer, fit_gyro_offset, fit_mount
from gravcomp.orientation.errors import CalibrationError
from gravcomp.orientation.known_directions import show_sign
from gravcomp.orientation.resting_poses import RestingPose, resting_poses
from gravcomp.recordings.imu import Recording

SIX = np.vstack([np.eye(3), -np.eye(3)])
SCALE, OFFSET = np.array([1.01, 0.98, 1.005]), np.array([0.1, -0.05, 0.2])


def poses_of(directions, seed=1):
    random = np.random.default_rng(seed)
    return [RestingPose(9.81 * d / SCALE + OFFSET + random.normal(0, 0.001, 3), np.zeros(3), 500) for d in directions]


def test_six_poses_give_scale_and_offset():
    fit = fit_accelerometer(poses_of(SIX))
    assert fit.scale == pytest.approx(SCALE, abs=3 * fit.scale_std.max())
    assert fit.offset == pytest.approx(OFFSET, abs=3 * fit.offset_std.max())
    assert fit.residual_after < 0.1 * fit.residual_before


def test_few_poses_correct_what_they_determine_and_report_their_uncertainty():
    fit = fit_accelerometer(poses_of(SIX[2:3]))
    assert fit.residual_after < 0.1 * fit.residual_before
    assert fit.scale[:2] == pytest.approx([1.0, 1.0], abs=1e-6)
    assert fit.offset_std[0] > 10 * fit_accelerometer(poses_of(SIX)).offset_std[0]


def test_the_mount_is_found_from_two_poses():
    rpy = (0.2, -0.5, 1.1)
    mount = quat.matrix(quat.from_roll_pitch_yaw(*rpy))
    up = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    assert fit_mount(9.81 * up @ mount, up) == pytest.approx(rpy, abs=1e-9)


def test_poses_along_one_line_do_not_determine_the_mount():
    with pytest.raises(CalibrationError, match="one more pose"):
        fit_mount(np.array([[0, 0, 9.81], [0, 0, -9.81]]), np.array([[0, 0, 1.0], [0, 0, -1.0]]))


@pytest.mark.parametrize("mirrored", [-np.eye(3), np.diag([1.0, -1.0, 1.0])])
def test_a_negated_accelerometer_is_refused_where_the_poses_show_it(mirrored):
    up = SIX[:3]
    measured = 9.81 * up @ mirrored @ quat.matrix(quat.from_roll_pitch_yaw(0.2, -0.5, 1.1))
    with pytest.raises(CalibrationError, match="the accelerometer is negated, or its axes are left-handed"):
        fit_mount(measured, up)


def test_poses_in_another_order_than_their_directions_are_refused():
    up = np.vstack([SIX[:4], [[0.6, 0.8, 0.0]]])
    with pytest.raises(CalibrationError, match=r"pose \d of 5 is off by \d+ deg, at most 15 deg"):
        fit_mount(9.81 * up[[0, 1, 2, 4, 3]], up)


def test_poses_in_one_plane_do_not_show_the_sign():
    assert not show_sign(SIX[:2]) and not show_sign(SIX[[0, 1, 3, 4]]) and show_sign(SIX[:3])


def test_rests_are_found_in_a_recording_and_the_same_pose_counts_once():
    random = np.random.default_rng(2)
    gyro, accel = [], []
    for direction in (SIX[2], SIX[0], SIX[2]):
        gyro.append(np.full((600, 3), 0.01) + random.normal(0, 0.002, (600, 3)))
        accel.append(9.81 * direction + random.normal(0, 0.02, (600, 3)))
        gyro.append(random.normal(0, 1.0, (100, 3)))  # in the hand
        accel.append(9.81 * direction + random.normal(0, 3.0, (100, 3)))
    gyro, accel = np.vstack(gyro), np.vstack(accel)
    recording = Recording("made", np.arange(len(gyro)) * 10_000_000, gyro, accel)
    poses = resting_poses(recording)
    assert [np.argmax(np.abs(p.accel)) for p in poses] == [2, 0]
    assert poses[0].count > poses[1].count
    assert fit_gyro_offset(poses) == pytest.approx([0.01] * 3, abs=1e-3)


def test_a_recording_without_rest_is_refused():
    random = np.random.default_rng(3)
    recording = Recording(
        "hand.npz", np.arange(500) * 10_000_000, random.normal(0, 1.0, (500, 3)), random.normal(0, 5.0, (500, 3))
    )
    with pytest.raises(CalibrationError, match=r"hand.npz: the sensor never rests for 1.5 s"):
        resting_poses(recording)


def test_a_mount_may_be_half_a_turn():
    up = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])
    flipped = up @ quat.matrix(quat.from_roll_pitch_yaw(math.pi, 0.0, 0.0))
    roll, pitch, yaw = fit_mount(flipped, up)
    assert (abs(roll), pitch, yaw) == pytest.approx((math.pi, 0.0, 0.0), abs=1e-9)
