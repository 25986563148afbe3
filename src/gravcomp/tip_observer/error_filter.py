"""Kalman filter of the model's error.

The true tip is the model's plus

    d = o + s h,

with an offset o (3,) in soft_base that walks at random (creep, hysteresis, cables) and a relative error s of weight over
stiffness (modulus, density), which acts along the model's own sensitivity h (3,) (`history.Prediction.sensitivity`): what is
learnt about s in one direction of gravity holds in all others. A measurement gives d with noise (Kalman, 1960). The gate against
outliers is that of Bar-Shalom, Li and Kirubarajan (Estimation with applications to tracking and navigation, 2001).
"""

import copy

import numpy as np

GATE = 21.1
"""Squared Mahalanobis distance of an outlier: 1 in 10000 good measurements with three coordinates is farther (chi-square)."""


class ErrorFilter:
    """State x = (o, s) with covariance; m and 1."""

    def __init__(self, offset_std: float, scale_std: float):
        """offset_std in m and scale_std: standard deviations before the first measurement."""
        self.state = np.zeros(4)
        self.covariance = np.diag([offset_std**2] * 3 + [scale_std**2])

    def copy(self) -> "ErrorFilter":
        """Return a filter in the same state; the steps of one do not change the other."""
        other = copy.copy(self)
        other.state, other.covariance = self.state.copy(), self.covariance.copy()
        return other

    def error(self, sensitivity: np.ndarray) -> np.ndarray:
        """Return the model's error (3,) in m where its sensitivity is (3,) in m."""
        return self.state[:3] + self.state[3] * sensitivity

    def diffuse(self, offset_variance: float, scale_variance: float) -> None:
        """Add what may have changed since the last call: variances in m^2 of each coordinate of o, and of s."""
        self.covariance[np.diag_indices(4)] += [offset_variance] * 3 + [scale_variance]

    def distance(self, residual: np.ndarray, sensitivity: np.ndarray, noise: np.ndarray) -> float:
        """Return the squared Mahalanobis distance of a residual (3,) in m, with the noise covariance (3, 3) in m^2."""
        innovation = residual - self.error(sensitivity)
        return float(innovation @ np.linalg.solve(self._spread(sensitivity) + noise, innovation))

    def update(self, residual: np.ndarray, sensitivity: np.ndarray, noise: np.ndarray) -> None:
        """Take a residual (3,): measured minus modelled tip, in m; the other arguments as in `distance`."""
        row = _row(sensitivity)
        gain = np.linalg.solve(row @ self.covariance @ row.T + noise, row @ self.covariance).T
        self.state += gain @ (residual - row @ self.state)
        kept = np.eye(4) - gain @ row
        self.covariance = kept @ self.covariance @ kept.T + gain @ noise @ gain.T

    def _spread(self, sensitivity: np.ndarray) -> np.ndarray:
        row = _row(sensitivity)
        return row @ self.covariance @ row.T


def _row(sensitivity: np.ndarray) -> np.ndarray:
    return np.column_stack([np.eye(3), sensitivity])
