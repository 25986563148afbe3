"""Motions of the base of the virtual robot."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gravcomp.config import ConfigError, from_mapping
from gravcomp.graph.parameters.virtual_robot import MOTIONS, VirtualRobotNodeParameters
from gravcomp.recordings.imu import Recording, RecordingError
from gravcomp.virtual.motion import (
    FollowedMotion,
    WaypointMotion,
    arm_poses,
    base_orientation,
    quaternion,
    rotation_from_quaternion,
    tilting,
    turned,
)
from gravcomp.virtual.motions import make_motion
from gravcomp.virtual.recorded_motion import RecordedMotion

DOWN = np.array([0.0, 0.0, -1.0])


def angle_between(a, b):
    return Rotation.from_matrix(a.T @ b).magnitude()


def test_inclination_gives_gravity_as_the_reference_solutions_have_it():
    for degrees in (-45, 0, 45, 90, 135):
        i = math.radians(degrees)
        np.testing.assert_allclose(base_orientation(i).T @ DOWN, [-math.cos(i), 0.0, -math.sin(i)], atol=1e-12)
    assert np.linalg.det(base_orientation(0.3, 0.4)) == pytest.approx(1.0)


def test_quaternions_and_rotations_are_inverse():
    random = np.random.default_rng(3)
    for _ in range(50):
        rotation = turned(random.uniform(-math.pi, math.pi, 3))
        np.testing.assert_allclose(rotation_from_quaternion(*quaternion(rotation)), rotation, atol=1e-12)
    with pytest.raises(ValueError, match="not a quaternion"):
        rotation_from_quaternion(0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("motion", [m for m in MOTIONS if m != "recording"])
def test_profiles_are_rotations_that_move_without_jumps(motion):
    parameters = from_mapping(VirtualRobotNodeParameters, {"motion": motion, "hold": 1.0}, source="test")
    base = make_motion(parameters, np.eye(3), 1)
    rotations, positions = map(np.array, zip(*(base.pose(k * 0.005) for k in range(4000))))
    np.testing.assert_allclose(rotations @ rotations.transpose(0, 2, 1), np.tile(np.eye(3), (4000, 1, 1)), atol=1e-9)
    steps = Rotation.from_matrix(rotations[:-1].transpose(0, 2, 1) @ rotations[1:]).magnitude()
    # Tremor is fastest: about 60 deg/s; minimum jerk peaks at 1.875 times its mean.
    assert steps.max() < math.radians(100) * 0.005
    assert np.abs(positions).max() < 0.02


def test_waypoints_are_reached_and_held():
    a, b = base_orientation(0.0), base_orientation(1.0)
    motion = WaypointMotion([(a, 2.0), (b, 3.0)], rate=0.5)
    assert motion.duration == pytest.approx(2.0 + 2.0 + 3.0)
    np.testing.assert_allclose(motion.pose(1.9)[0], a, atol=1e-12)
    np.testing.assert_allclose(motion.pose(4.1)[0], b, atol=1e-9)
    np.testing.assert_allclose(motion.pose(100.0)[0], b, atol=1e-9)
    assert angle_between(a, motion.pose(3.0)[0]) == pytest.approx(0.5)


def test_the_arm_takes_the_articles_five_directions():
    motion, seen = arm_poses(5.0, math.radians(23)), set()
    for time in np.arange(0.0, motion.duration, 0.5):
        z = motion.pose(time)[0][:, 2]
        seen.add(round(math.degrees(math.atan2(z[2], z[0]))))
    assert {135, 90, 45, 0, -45} <= seen


def test_the_tilting_profile_starts_horizontally_and_ends_there():
    motion = tilting(4.0, math.radians(30))
    for time in (0.0, 3.9, motion.duration):
        np.testing.assert_allclose(motion.pose(time)[0].T @ DOWN, [-1.0, 0.0, 0.0], atol=1e-9)


def test_a_followed_base_arrives_smoothly_whatever_jump_is_asked_for():
    motion, target = FollowedMotion(base_orientation(0.0)), base_orientation(2.5, 1.0)
    motion.pose(0.0)
    motion.follow(target)
    rotations = np.array([motion.pose(k * 0.002)[0] for k in range(1, 2000)])
    steps = Rotation.from_matrix(rotations[:-1].transpose(0, 2, 1) @ rotations[1:]).magnitude()
    fastest = steps.max() / 0.002
    assert angle_between(rotations[-1], target) < 1e-4
    assert math.radians(180) < fastest < math.radians(361)


def recording(rate=286.0, seconds=4.0, gap=False):
    """A sensor that turns about its x axis at 0.5 rad/s."""
    time = np.arange(0.0, seconds, 1 / rate)
    half = 0.25 * time
    orientation = np.stack([np.cos(half), np.sin(half), 0 * half, 0 * half], axis=1)
    if gap:
        orientation[300:500] = np.nan
    gyro = np.tile([0.5, 0.0, 0.0], (len(time), 1))
    accel = np.stack([0 * time, 9.81 * np.sin(0.5 * time), 9.81 * np.cos(0.5 * time)], axis=1)
    if gap:
        gyro[100], accel[100] = np.nan, np.nan
    return Recording("made up", (time * 1e9).astype(np.int64), gyro, accel, orientation=orientation)


@pytest.mark.parametrize("gap", [False, True])
def test_a_recording_turns_the_base_as_its_truth_and_keeps_the_turned_angle(gap):
    mount = turned([0.0, 0.5, 0.0])
    motion = RecordedMotion(recording(gap=gap), mount)
    for time in (0.0, 0.777, 1.5, 3.0):
        np.testing.assert_allclose(motion.pose(time)[0] @ mount, turned([0.5 * time, 0.0, 0.0]), atol=1e-6)
    sampled = np.array([motion.imu(k * 0.01, 0.01)[0] for k in range(1, 390)])
    np.testing.assert_allclose(sampled.sum(axis=0) * 0.01, [0.5 * 3.89, 0.0, 0.0], atol=1e-6)
    force = motion.imu(2.0, 0.01)[1]
    np.testing.assert_allclose(mount @ force, -9.81 * (motion.pose(1.995)[0].T @ DOWN), atol=0.02)


def test_beyond_its_end_a_recording_is_at_rest():
    motion = RecordedMotion(recording(), np.eye(3))
    np.testing.assert_allclose(motion.pose(100.0)[0], motion.pose(motion.duration)[0])
    assert motion.imu(100.0, 0.01) is None


def test_a_recording_without_truth_or_none_at_all_is_refused():
    full = recording()
    with pytest.raises(RecordingError, match="no ground truth"):
        RecordedMotion(Recording(full.source, full.stamp_ns, full.gyro, full.accel), np.eye(3))
    parameters = from_mapping(VirtualRobotNodeParameters, {"motion": "recording"}, source="test")
    with pytest.raises(ConfigError, match="'recording' is empty"):
        make_motion(parameters, np.eye(3), 1)
