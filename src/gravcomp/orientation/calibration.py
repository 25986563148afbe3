"""Calibration of the IMU from poses at rest: accelerometer scale and offset, gyroscope offset, mounting rotation.

Accelerometer: at rest the corrected specific force has the length of gravity in every pose k,

    | s (a_k - o) | = g,    minimised with priors s ~ (1, 0.03), o ~ (0, 0.3 m/s^2),

so a few poses correct what they determine and leave the rest at its prior (D. Tedaldi, A. Pretto, E. Menegatti, "A robust and
easy to implement method for IMU calibration without external equipments", ICRA 2014, without axis misalignment). Mount: the
rotation that best turns the measured directions of gravity into the known ones in `soft_base` (Wahba's problem, solved by scipy).
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from gravcomp.orientation.errors import CalibrationError
from gravcomp.orientation.imu_calibration import ImuCalibration
from gravcomp.orientation.known_directions import check_directions
from gravcomp.orientation.options import FilterOptions
from gravcomp.orientation.resting_poses import DISTINCT, RestingPose, resting_poses
from gravcomp.recordings.imu import Recording

SCALE_PRIOR = 0.03
OFFSET_PRIOR = 0.3  # m/s^2
POSE_NOISE = 0.005  # m/s^2: error of the mean over a rest, from vibration and temperature
LARGEST_ERROR = 0.2  # of gravity: a larger error of |a| at rest is not a calibration error


@dataclass(frozen=True)
class AccelerometerFit:
    """Scale and offset with their standard deviations, and the residual | |a| - g |."""

    scale: np.ndarray  # (3,)
    offset: np.ndarray  # (3,) m/s^2
    scale_std: np.ndarray  # (3,)
    offset_std: np.ndarray  # (3,) m/s^2
    residual_before: float  # m/s^2, RMS over the poses
    residual_after: float  # m/s^2, RMS over the poses


@dataclass(frozen=True)
class RestCalibration:
    """Result of the calibration from one recording; `mount`: roll, pitch, yaw (rad) in soft_base, None where it is not fitted."""

    poses: list[RestingPose]
    accelerometer: AccelerometerFit
    gyro_offset: np.ndarray  # (3,) rad/s
    mount: tuple[float, float, float] | None

    @property
    def known_axes(self) -> tuple[bool, bool, bool]:
        """Whether the poses determine the scale of each axis; where they do not, it stays near 1."""
        x, y, z = (bool(std < 0.5 * SCALE_PRIOR) for std in self.accelerometer.scale_std)
        return x, y, z

    @property
    def correction(self) -> ImuCalibration:
        """Correction for the estimator."""
        fit = self.accelerometer
        return ImuCalibration(tuple(fit.scale.tolist()), tuple(fit.offset.tolist()), tuple(self.gyro_offset.tolist()))


def calibrate(recording: Recording, options: FilterOptions | None = None, base_up: np.ndarray | None = None) -> RestCalibration:
    """Return what the rests of a raw recording determine.

    base_up (k, 3): for each distinct pose, in the order of the recording, the direction in soft_base that pointed up; without it
    the mount is not fitted. Raises CalibrationError where the sensor never rests, where |a| at rest is not near gravity, and
    where `base_up` does not fit the poses.
    """
    options = options or FilterOptions()
    poses = resting_poses(recording, options)
    for length in (float(np.linalg.norm(pose.accel)) for pose in poses):
        if abs(length - options.gravity) > LARGEST_ERROR * options.gravity:
            raise CalibrationError(
                f"{recording.source}: |a| at rest is {length:.2f} m/s^2, gravity is {options.gravity:g}:"
                " wrong unit (m/s^2 is needed), or the sensor is broken"
            )
    fit = fit_accelerometer(poses, options.gravity)
    mount = None
    if base_up is not None:
        if len(base_up) != len(poses):
            raise CalibrationError(
                f"{recording.source}: has {len(poses)} distinct pose(s) at rest,"
                f" but {len(base_up)} direction(s) that pointed up are given"
            )
        try:
            mount = fit_mount(np.array([fit.scale * (pose.accel - fit.offset) for pose in poses]), base_up)
        except CalibrationError as error:
            raise CalibrationError(f"{recording.source}: {error}") from error
    return RestCalibration(poses, fit, fit_gyro_offset(poses), mount)


def fit_accelerometer(poses: list[RestingPose], gravity: float = 9.81) -> AccelerometerFit:
    """Return scale and offset with which every pose has the length of gravity (m/s^2)."""
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
    """Return the mean rate of all rests, (3,) rad/s."""
    return np.average([pose.gyro for pose in poses], axis=0, weights=[pose.count for pose in poses])


def fit_mount(accel: np.ndarray, base_up: np.ndarray) -> tuple[float, float, float]:
    """Return roll, pitch, yaw (rad) of the IMU in soft_base, from at least two poses.

    accel (k, 3): mean specific forces in the IMU's frame; base_up (k, 3): the direction in soft_base that pointed up at the same
    time. Raises CalibrationError where the poses do not determine all three angles, and where no mount fits them.
    """
    measured = np.asarray(accel, float) / np.linalg.norm(accel, axis=1, keepdims=True)
    known = np.asarray(base_up, float) / np.linalg.norm(base_up, axis=1, keepdims=True)
    singular = np.linalg.svd(known.T @ measured, compute_uv=False)
    if singular[1] < math.sin(DISTINCT) ** 2:
        raise CalibrationError(
            f"{len(measured)} pose(s) with gravity along one line do not determine the rotation about this line;"
            " one more pose, at least 15 deg away, is needed"
        )
    check_directions(measured, known)
    rotation, _ = Rotation.align_vectors(known, measured)
    roll, pitch, yaw = rotation.as_euler("xyz").tolist()
    return roll, pitch, yaw
