"""Estimate gravity from a recorded IMU stream with the error-state Kalman filter of gravcomp.orientation.

gravity in soft_base = R_mount R(q)^T (0, 0, -g)

python gravity_from_recording.py [FILE]     FILE: .npz in BROAD's layout or a rosbag2 folder; without it: a synthetic rotation
"""

import sys

import numpy as np

from gravcomp.description import load_robot_file
from gravcomp.orientation.estimator import GravityEstimator
from gravcomp.orientation.offline import estimate_recording
from gravcomp.orientation.quaternion import from_roll_pitch_yaw
from gravcomp.recordings.imu import Recording, read_recording


def turning_sensor() -> tuple[Recording, np.ndarray]:
    """Return a synthetic recording and the true gravity (n, 3) in the sensor's frame in m/s^2.

    20 s at 100 Hz: at rest for 8 s, turned about x by 90 deg in 3 s, at rest again; with noise and 0.5 deg/s of bias.
    """
    rate, random = 100.0, np.random.default_rng(1)
    time = np.arange(2000) / rate
    angle = np.radians(90.0) * np.clip((time - 8.0) / 3.0, 0.0, 1.0)
    turning = np.radians(30.0) * ((time > 8.0) & (time <= 11.0))
    up = np.stack([np.zeros_like(angle), np.sin(angle), np.cos(angle)], axis=1)
    gyro = turning[:, None] * [1.0, 0.0, 0.0] + np.radians([0.5, -0.3, 0.2]) + random.normal(0.0, 0.002, (2000, 3))
    accel = 9.81 * up + random.normal(0.0, 0.02, (2000, 3))  # specific force points up at rest
    return Recording("synthetic rotation", (time * 1e9).astype(np.int64), gyro, accel), -9.81 * up


recording, truth = (read_recording(sys.argv[1]), None) if len(sys.argv) > 1 else turning_sensor()
mount = from_roll_pitch_yaw(*load_robot_file("article").robot.imu_mount.rpy)  # imu_link in soft_base
estimated = estimate_recording(recording, GravityEstimator(mount=mount))

print(f"{recording.source}: {len(recording)} samples at {recording.rate:.1f} Hz, {estimated.rest.mean():.0%} of them at rest")
for i in np.linspace(0, len(recording) - 1, 6).astype(int):
    time = 1e-9 * (recording.stamp_ns[i] - recording.stamp_ns[0])
    gravity = ", ".join(f"{value:+6.3f}" for value in estimated.gravity[i])
    deviation = np.degrees(estimated.inclination_std[i])
    print(f"{time:6.2f} s: gravity ({gravity}) m/s^2 in soft_base, standard deviation {deviation:.2f} deg")
print("gyroscope bias:", np.round(np.degrees(estimated.bias[-1]), 3), "deg/s")

if truth is not None:
    in_base = truth @ load_robot_file("article").robot.imu_mount.rotation.T
    cosine = np.sum(estimated.gravity * in_base, axis=1) / 9.81**2
    error = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
    print(f"worst error while turning and after: {error[800:].max():.2f} deg")
