"""Calibration of the accelerometer from any recording in which the sensor turns, without poses at rest.

The mean specific force over a window, turned back by the rates to the window's beginning, is gravity plus the change of the
velocity over the window's length. A sensor that stays in one place changes its velocity by little, so over many windows w the
corrected mean has the length of gravity:

    | B_w s - M_w c | = g,    B_w = mean_k R_k diag(a_k),  M_w = mean_k R_k,  c_i = s_i o_i,

with scale s and offset o, minimised with the priors of `calibration`. The residual is linear in (s, c) but for the length; its
outliers are windows in which the sensor gathers speed.
"""

import dataclasses

import numpy as np
from scipy.spatial.transform import Rotation

from gravcomp.orientation.calibration import OFFSET_PRIOR, SCALE_PRIOR
from gravcomp.orientation.errors import CalibrationError
from gravcomp.orientation.imu_calibration import ImuCalibration
from gravcomp.recordings.imu import Recording

WINDOW = 2.0  # s
_FEWEST = 10  # windows
_NOISE = 0.1  # m/s^2, of the mean over a window
_STILL = np.radians(1.0)  # rad/s: a window whose rate varies less shows the gyroscope's offset
_LARGEST_OFFSET = np.radians(5.0)  # rad/s
_PASSES = 3  # the noise follows from the residuals of the pass before
KNOWN = 0.4  # of the prior: an offset that is less certain is not determined


def calibrate_in_motion(recording: Recording, gravity: float = 9.81) -> ImuCalibration:
    """Return scale and offset of the accelerometer (3,) each. Raises CalibrationError where the motion leaves it open."""
    from scipy.optimize import least_squares

    period = 1.0 / recording.rate
    count = max(4, round(WINDOW / period))
    windows = len(recording) // count
    if windows < _FEWEST:
        raise CalibrationError(
            f"{recording.source}: has {recording.duration:.0f} s; {_FEWEST * WINDOW:.0f} s in motion are needed to calibrate"
        )
    shape = (windows, count, 3)
    gyro = np.nan_to_num(recording.gyro[: windows * count]).reshape(shape)
    accel = np.nan_to_num(recording.accel[: windows * count]).reshape(shape)
    gyro = gyro - _offset(gyro)
    turned, by_axis = np.zeros((windows, 3, 3)), np.zeros((windows, 3, 3))
    attitude = Rotation.identity(windows)
    for k in range(count):
        matrix = attitude.as_matrix()
        turned += matrix / count
        by_axis += matrix * accel[:, k, None, :] / count
        attitude = attitude * Rotation.from_rotvec(gyro[:, k] * period)

    def excess(unknown: np.ndarray) -> np.ndarray:
        return np.linalg.norm(by_axis @ unknown[:3] - turned @ unknown[3:], axis=1) - gravity

    def residuals(unknown: np.ndarray, noise: float) -> np.ndarray:
        priors = (unknown[:3] - 1.0) / SCALE_PRIOR, unknown[3:] / OFFSET_PRIOR
        return np.concatenate([_soft(excess(unknown) / noise), *priors])

    unknown, noise = np.r_[np.ones(3), np.zeros(3)], _NOISE
    for _ in range(_PASSES):
        solution = least_squares(residuals, unknown, args=(noise,))
        unknown = solution.x
        noise = max(_NOISE, float(1.48 * np.median(np.abs(excess(unknown)))))
    std = np.sqrt(np.diag(np.linalg.inv(solution.jac.T @ solution.jac)))[3:]
    if std.max() > KNOWN * OFFSET_PRIOR:
        raise CalibrationError(
            f"{recording.source}: its motion determines the offset of the accelerometer to {std.max():.2f} m/s^2 only;"
            " turn the sensor slowly in all directions to calibrate it"
        )
    return ImuCalibration(tuple(unknown[:3].tolist()), tuple((unknown[3:] / unknown[:3]).tolist()))


def calibrated(recording: Recording, correction: ImuCalibration) -> Recording:
    """Return the recording with the corrected specific force."""
    accel = (recording.accel - np.array(correction.accel_offset)) * np.array(correction.accel_scale)
    return dataclasses.replace(recording, accel=accel)


def _soft(residual: np.ndarray) -> np.ndarray:
    """Return residuals whose square grows like |r| far out."""
    return np.sign(residual) * np.sqrt(2.0 * (np.sqrt(1.0 + residual**2) - 1.0))


def _offset(gyro: np.ndarray) -> np.ndarray:
    """Return the mean rate (3,) of the windows at rest, zero where there are none."""
    mean = gyro.mean(axis=1)
    still = (gyro.std(axis=1).max(axis=1) < _STILL) & (np.abs(mean).max(axis=1) < _LARGEST_OFFSET)
    return np.median(mean[still], axis=0) if still.any() else np.zeros(3)
