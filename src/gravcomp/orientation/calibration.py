"""Calibration of the IMU from resting poses: accelerometer scale and offset, gyroscope offset, mounting rotation.

Accelerometer: at rest the corrected specific force has the length of gravity in every pose k,

    | s (a_k - o) | = g,    minimised with priors s ~ (1, 0.03), o ~ (0, 0.3 m/s^2),

so few poses correct what they show and leave the rest alone (D. Tedaldi, A. Pretto, E. Menegatti, "A robust and easy to
implement method for IMU calibration without external equipments", ICRA 2014, without axis misalignment). Mount: the turn that
best takes the measured directions of gravity to the known ones in `soft_base` (Wahba's problem, solved by SVD).
"""

import math
from dataclasses import dataclass

import numpy as np

from gravcomp.config import parameter
from gravcomp.orientation.options import FilterOptions
from gravcomp.orientation.rest import RestDetector
from gravcomp.recordings.imu import Recording

SCALE_PRIOR = 0.03
OFFSET_PRIOR = 0.3  # m/s^2
POSE_NOISE = 0.005  # m/s^2: of a mean over a rest, what vibration and temperature leave
LARGEST_ERROR = 0.2  # of gravity: |a| at rest farther off is no matter of calibration
DISTINCT = math.radians(15.0)  # rests closer than that in direction are the same pose


class CalibrationError(ValueError):
    """The recording does not show what shall be calibrated; the text says what is missing."""


@dataclass(frozen=True)
class ImuCalibration:
    """corrected specific force = accel_scale (a - accel_offset), corrected rate = rate - gyro_offset."""

    accel_scale: tuple[float, float, float] = parameter(
        (1.0, 1.0, 1.0), minimum=0.5, maximum=2, description="accelerometer scale, by axis"
    )
    accel_offset: tuple[float, float, float] = parameter(
        (0.0, 0.0, 0.0), unit="m/s^2", minimum=-5, maximum=5, description="accelerometer offset, by axis"
    )
    gyro_offset: tuple[float, float, float] = parameter(
        (0.0, 0.0, 0.0), edge="deg/s", minimum=-20, maximum=20, description="gyroscope offset, by axis"
    )
    norm_tolerance: float = parameter(
        0.3,
        unit="m/s^2",
        minimum=0.01,
        maximum=5,
        description="|a| at rest farther from gravity than that: calibration is needed",
    )


@dataclass(frozen=True)
class RestingPose:
    """The means over one rest."""

    accel: np.ndarray  # (3,) m/s^2
    gyro: np.ndarray  # (3,) rad/s
    count: int


@dataclass(frozen=True)
class AccelerometerFit:
    """Scale and offset with their standard deviations, and what remains of | |a| - g |."""

    scale: np.ndarray  # (3,)
    offset: np.ndarray  # (3,) m/s^2
    scale_std: np.ndarray  # (3,)
    offset_std: np.ndarray  # (3,) m/s^2
    residual_before: float  # m/s^2, RMS over the poses
    residual_after: float  # m/s^2, RMS over the poses


@dataclass(frozen=True)
class RestCalibration:
    """What the rests of one recording tell of the IMU; `mount`: roll, pitch, yaw (rad) in soft_base, None where not asked for."""

    poses: list[RestingPose]
    accelerometer: AccelerometerFit
    gyro_offset: np.ndarray  # (3,) rad/s
    mount: tuple[float, float, float] | None

    @property
    def known_axes(self) -> tuple[bool, bool, bool]:
        """Whether the poses showed the scale of each axis; where they did not, it is hardly moved from 1."""
        return tuple(bool(std < 0.5 * SCALE_PRIOR) for std in self.accelerometer.scale_std)

    @property
    def correction(self) -> ImuCalibration:
        """What the estimator takes."""
        fit = self.accelerometer
        return ImuCalibration(tuple(fit.scale.tolist()), tuple(fit.offset.tolist()), tuple(self.gyro_offset.tolist()))


def calibrate(recording: Recording, options: FilterOptions | None = None, base_up: np.ndarray | None = None) -> RestCalibration:
    """Everything that the rests of a raw recording tell.

    base_up (k, 3): for each distinct pose, in the order of the recording, the direction in soft_base that pointed up; without it the mount
    is not fitted. Raises CalibrationError.
    """
    options = options or FilterOptions()
    poses = resting_poses(recording, options)
    for length in (float(np.linalg.norm(pose.accel)) for pose in poses):
        if abs(length - options.gravity) > LARGEST_ERROR * options.gravity:
            raise CalibrationError(
                f"{recording.source}: |a| at rest is {length:.2f} m/s^2 where gravity is {options.gravity:g}: a wrong unit (m/s^2 are needed), or broken"
            )
    fit = fit_accelerometer(poses, options.gravity)
    mount = None
    if base_up is not None:
        if len(base_up) != len(poses):
            raise CalibrationError(
                f"{recording.source}: holds {len(poses)} distinct resting pose(s); {len(base_up)} direction(s) that pointed up are given"
            )
        mount = fit_mount(np.array([fit.scale * (pose.accel - fit.offset) for pose in poses]), base_up)
    return RestCalibration(poses, fit, fit_gyro_offset(poses), mount)


def resting_poses(recording: Recording, options: FilterOptions | None = None) -> list[RestingPose]:
    """The rests of the recording in their order, those in about the same direction joined. Raises CalibrationError: none."""
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
            f"{recording.source}: the sensor never rests for {options.rest.minimum_time:g} s; lay it down in several poses, each for 5 s"
        )
    return _joined([_pose(recording, indices) for indices in rests])


def fit_accelerometer(poses: list[RestingPose], gravity: float = 9.81) -> AccelerometerFit:
    """Scale and offset that give every pose the length of gravity."""
    from scipy.optimize import least_squares

    accel = np.array([pose.accel for pose in poses])  # (k, 3)

    def residuals(unknown: np.ndarray) -> np.ndarray:
        scale, offset = unknown[:3], unknown[3:]
        length = np.linalg.norm(scale * (accel - offset), axis=1)
        return np.concatenate([(length - gravity) / POSE_NOISE, (scale - 1.0) / SCALE_PRIOR, offset / OFFSET_PRIOR])

    solution = least_squares(residuals, np.r_[np.ones(3), np.zeros(3)])
    std = np.sqrt(np.diag(np.linalg.inv(solution.jac.T @ solution.jac)))
    before = np.linalg.norm(accel, axis=1) - gravity
    after = solution.fun[: len(accel)] * POSE_NOISE
    return AccelerometerFit(
        scale=solution.x[:3],
        offset=solution.x[3:],
        scale_std=std[:3],
        offset_std=std[3:],
        residual_before=float(np.sqrt(np.mean(before**2))),
        residual_after=float(np.sqrt(np.mean(after**2))),
    )


def fit_gyro_offset(poses: list[RestingPose]) -> np.ndarray:
    """The mean rate of all rests, (3,) rad/s."""
    return np.average([pose.gyro for pose in poses], axis=0, weights=[pose.count for pose in poses])


def fit_mount(accel: np.ndarray, base_up: np.ndarray) -> tuple[float, float, float]:
    """Roll, pitch, yaw (rad) of the IMU in soft_base, from at least two poses.

    accel (k, 3): mean specific forces in the IMU's frame; base_up (k, 3): the direction that pointed up then, in soft_base.
    Raises CalibrationError when the poses do not fix all three angles.
    """
    measured = np.asarray(accel, float) / np.linalg.norm(accel, axis=1, keepdims=True)
    known = np.asarray(base_up, float) / np.linalg.norm(base_up, axis=1, keepdims=True)
    left, singular, right = np.linalg.svd(known.T @ measured)
    if singular[1] < math.sin(DISTINCT) ** 2:
        raise CalibrationError(
            f"{len(measured)} pose(s) with gravity along one line do not tell the turn about it; one more pose, at least 15 deg away, is needed"
        )
    turn = left @ np.diag([1.0, 1.0, np.linalg.det(left) * np.linalg.det(right)]) @ right
    return (
        math.atan2(turn[2, 1], turn[2, 2]),
        math.asin(min(max(-turn[2, 0], -1.0), 1.0)),
        math.atan2(turn[1, 0], turn[0, 0]),
    )


def _pose(recording: Recording, indices: list[int]) -> RestingPose:
    return RestingPose(recording.accel[indices].mean(axis=0), recording.gyro[indices].mean(axis=0), len(indices))


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
