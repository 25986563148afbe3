"""Covariance of the orientation filter's error state: prediction, and correction by two pseudo-measurements.

The error state is x = (theta, db, dv): orientation in the earth's frame (R_true = exp(theta) R), bias of the gyroscope in the
sensor's frame, velocity in the earth's frame. It is the invariant form (A. Barrau, S. Bonnabel, "The Invariant Extended Kalman
Filter as a Stable Observer", IEEE TAC 2017), in which the error of the velocity depends on theta through gravity only:

    theta' = -R db,    db' = 0,    dv' = -[g]x theta

Pseudo-measurements: 'the velocity is zero', always; 'the mean rate is the bias', at rest. The covariance algebra is filterpy's
KalmanFilter.
"""

import math

import numpy as np

from gravcomp.orientation import quaternion as quat
from gravcomp.orientation.filterpy_import import kalman_filter_class

_UNITY = {size: np.eye(size) for size in (3, 6)}  # of the measurements: velocity, and velocity with bias


class ErrorCovariance:
    """Covariance (9, 9) of the error state; `matrix` may be read after each call."""

    def __init__(self) -> None:
        self._kalman = kalman_filter_class()(dim_x=9, dim_z=3)  # imported here: what only reads orientations does without it
        self._kalman.inv = _inverse
        self._transition = np.eye(9)
        self._process = np.zeros((9, 9))
        self._process_diagonal = self._process.ravel()[::10]
        self._measure_velocity = np.hstack([np.zeros((3, 6)), np.eye(3)])
        self._measure_at_rest = np.vstack([self._measure_velocity, np.hstack([np.zeros((3, 3)), np.eye(3), np.zeros((3, 3))])])
        self._noise_velocity = np.zeros((3, 3))
        self._noise_at_rest = np.zeros((6, 6))
        self._zero = np.zeros((9, 1))
        self._vertical = np.zeros((9, 2))
        self._vertical[2, 1] = 1.0
        self.reset(np.zeros((9, 9)))

    @property
    def matrix(self) -> np.ndarray:
        """Covariance (9, 9)."""
        return self._kalman.P

    def reset(self, matrix: np.ndarray) -> None:
        """Set the covariance (9, 9)."""
        self._kalman.P = matrix

    def bias_std(self) -> list[float]:
        """Return the standard deviations (3,) of the bias, rad/s."""
        return [math.sqrt(v) for v in self._kalman.P.ravel()[30:51:10].tolist()]

    def set_bias_std(self, std: float) -> None:
        """Set the standard deviation of the bias (rad/s) on each axis and remove its correlations."""
        covariance = self._kalman.P
        covariance[3:6, :] = 0.0
        covariance[:, 3:6] = 0.0
        covariance[3:6, 3:6] = np.eye(3) * std**2

    def set_tilt_and_velocity_std(self, tilt: float, velocity: float, together: float) -> None:
        """Set the standard deviations of the inclination (rad) and of the velocity (m/s), and remove their correlations.

        together: correlation that remains, of each horizontal velocity with the inclination by which gravity causes it.
        """
        covariance, rows = self._kalman.P, [0, 1, 6, 7, 8]
        covariance[rows, :] = 0.0
        covariance[:, rows] = 0.0
        covariance[rows, rows] = [tilt**2] * 2 + [velocity**2] * 3
        covariance[[1, 6], [6, 1]] = together * tilt * velocity
        covariance[[0, 7], [7, 0]] = -together * tilt * velocity

    def decouple_bias(self) -> None:
        """Remove the correlation of the bias with orientation and velocity, and its effect on them in the prediction."""
        covariance = self._kalman.P
        for rows in (slice(0, 3), slice(6, 9)):
            covariance[rows, 3:6] = 0.0
            covariance[3:6, rows] = 0.0
        self._transition[0:3, 3:6] = 0.0
        self._transition[6:8, 3:6] = 0.0

    def predict(
        self,
        dt: float,
        orientation: quat.Quaternion,
        gravity: float,
        *,
        tilt: float,
        bias: float,
        velocity: float,
        bias_estimation: bool,
    ) -> None:
        """Predict over `dt` s with the orientation in the middle of the step.

        gravity: m/s^2; tilt, bias, velocity: variances that the step adds on each axis, rad^2, (rad/s)^2, (m/s)^2;
        bias_estimation: the error of the bias acts on orientation and velocity.
        """
        transition = self._transition
        turn = quat.matrix(orientation)
        gravity_dt = gravity * dt
        if bias_estimation:
            transition[0:3, 3:6] = turn * -dt
            transition[6, 3:6] = turn[1] * (-(0.5 * dt) * gravity_dt)
            transition[7, 3:6] = turn[0] * ((0.5 * dt) * gravity_dt)
        transition[6, 1] = gravity_dt
        transition[7, 0] = -gravity_dt
        self._process_diagonal[:] = (tilt, tilt, tilt, bias, bias, bias, velocity, velocity, velocity)
        self._kalman.predict(F=transition, Q=self._process)

    def correct_velocity(self, velocity: quat.Vector, variance: float, orientation: quat.Quaternion) -> list[float]:
        """Correct by 'the velocity is zero' with the variance in (m/s)^2; return the error state (9,)."""
        vx, vy, vz = velocity
        self._forget_vertical_bias(orientation)
        self._noise_velocity.ravel()[::4] = variance
        self._kalman.update(np.array(((-vx,), (-vy,), (-vz,))), R=self._noise_velocity, H=self._measure_velocity)
        return self._taken()

    def correct_at_rest(
        self, velocity: quat.Vector, bias_residual: quat.Vector, velocity_variance: float, bias_variance: float
    ) -> list[float]:
        """Correct by 'the velocity is zero' and 'the mean rate is the bias'; return the error state (9,).

        bias_residual (3,) rad/s: mean rate minus bias; variances in (m/s)^2 and (rad/s)^2.
        """
        vx, vy, vz = velocity
        bx, by, bz = bias_residual
        self._noise_at_rest.ravel()[:15:7] = velocity_variance
        self._noise_at_rest.ravel()[21::7] = bias_variance
        residual = np.array(((-vx,), (-vy,), (-vz,), (bx,), (by,), (bz,)))
        self._kalman.update(residual, R=self._noise_at_rest, H=self._measure_at_rest)
        return self._taken()

    def _taken(self) -> list[float]:
        """Return the error state after a correction and set it to zero."""
        kalman = self._kalman
        error = kalman.x.ravel().tolist()
        kalman.x = self._zero
        # Rounding makes the covariance slightly less symmetric with every sample.
        kalman.P = 0.5 * (kalman.P + kalman.P.T)
        return error

    def _forget_vertical_bias(self, orientation: quat.Quaternion) -> None:
        """Remove the correlation of yaw and of the bias about the vertical with the other errors.

        Yaw and this bias do not change the velocity; what correlates them with it is how the sensor was turned before. The
        velocity of a real motion is not white noise, so the filter would trust this small correlation far too much, and the bias
        would drift by degrees per second.
        """
        w, x, y, z = orientation
        apart = self._vertical  # (9, 2) orthonormal: the bias about earth's z, and yaw
        apart[3:6, 0] = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)
        # The correlation of the two with each other stays: (1 - E E^T) P (1 - E E^T) + E E^T P E E^T has two blocks, so it is
        # still a covariance.
        covariance = self._kalman.P
        related = apart.T @ covariance
        removed = apart @ (related - (related @ apart) @ apart.T)
        self._kalman.P = covariance - removed - removed.T


def _inverse(covariance: np.ndarray) -> np.ndarray:
    """Return what np.linalg.inv returns; its checks take longer than the inversion of so small a matrix."""
    from scipy.linalg.lapack import dgesv  # at the first sample, as filterpy

    *_, inverse, failed = dgesv(covariance, _UNITY[len(covariance)])
    if failed:
        raise np.linalg.LinAlgError("the innovation's covariance is singular")
    return inverse
