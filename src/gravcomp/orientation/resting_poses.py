"""Poses at rest in a recording: mean specific force and mean rate of each rest, rests in the same direction joined."""

import math
from dataclasses import dataclass, field

import numpy as np

from gravcomp.orientation.errors import CalibrationError
from gravcomp.orientation.options import FilterOptions
from gravcomp.orientation.rest import RestDetector
from gravcomp.recordings.imu import Recording

DISTINCT = math.radians(15.0)  # rests whose directions differ by less are the same pose


@dataclass(frozen=True)
class RestingPose:
    """Means over one rest."""

    accel: np.ndarray  # (3,) m/s^2
    gyro: np.ndarray  # (3,) rad/s
    count: int
    alongside: np.ndarray = field(default_factory=lambda: np.zeros(0))  # (n,) of what was given with the samples


def resting_poses(
    recording: Recording, options: FilterOptions | None = None, alongside: np.ndarray | None = None
) -> list[RestingPose]:
    """Return the rests of the recording in their order; rests in about the same direction are joined.

    alongside (samples, n): values of the samples that are averaged over the rests as well; rests are then not joined.
    Raises CalibrationError where the sensor never rests.
    """
    options = options or FilterOptions()
    detector = RestDetector(options.rest)
    finite = np.isfinite(recording.gyro).all(axis=1) & np.isfinite(recording.accel).all(axis=1)
    unknown_bias, anything = (0.0, 0.0, 0.0), (options.rest.largest_bias,) * 3
    period_limit = options.sensor.largest_gap
    rests: list[list[int]] = []
    resting = False
    last_ns = None
    for i in np.flatnonzero(finite).tolist():
        stamp_ns = int(recording.stamp_ns[i])
        dt = 0.0 if last_ns is None else (stamp_ns - last_ns) * 1e-9
        last_ns = stamp_ns
        if dt < 0.0 or dt > period_limit:
            detector.reset()
            resting = False
            continue
        now = detector.update(dt, recording.gyro[i].tolist(), recording.accel[i].tolist(), unknown_bias, anything)
        if now and not resting:
            rests.append([])
        if now:
            rests[-1].append(i)
        resting = now
    if not rests:
        raise CalibrationError(
            f"{recording.source}: the sensor never rests for {options.rest.minimum_time:g} s;"
            " lay it down in several poses, each for 5 s"
        )
    values = np.zeros((len(recording), 0)) if alongside is None else alongside
    poses = [_pose(recording, values, indices) for indices in rests]
    return _joined(poses) if alongside is None else poses


def _pose(recording: Recording, values: np.ndarray, indices: list[int]) -> RestingPose:
    accel, gyro, others = (part[indices].mean(axis=0) for part in (recording.accel, recording.gyro, values))
    return RestingPose(accel, gyro, len(indices), others)


def _joined(poses: list[RestingPose]) -> list[RestingPose]:
    distinct: list[RestingPose] = []
    for pose in poses:
        for k, other in enumerate(distinct):
            cosine = pose.accel @ other.accel / (np.linalg.norm(pose.accel) * np.linalg.norm(other.accel))
            if cosine > math.cos(DISTINCT):
                count = pose.count + other.count
                distinct[k] = RestingPose(
                    (pose.accel * pose.count + other.accel * other.count) / count,
                    (pose.gyro * pose.count + other.gyro * other.count) / count,
                    count,
                )
                break
        else:
            distinct.append(pose)
    return distinct
