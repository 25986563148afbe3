"""Inclination error: angle between the vertical of the estimated and of the true orientation, by BROAD's protocol.

With e = q conj(q_true) in the earth's frame it is 2 acos(sqrt(e_w^2 + e_z^2)), the angle of e without its yaw. This is the angle
by which e turns the vertical.
"""

import numpy as np
from scipy.spatial.transform import Rotation


def inclination_error(orientation: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Return the error of each sample, (n,) rad; both (n, 4) w x y z, sensor to earth; NaN where one of them is not finite."""
    known = np.isfinite(orientation).all(axis=1) & np.isfinite(truth).all(axis=1)
    error = np.full(len(known), np.nan)
    if known.any():
        estimated, true = (Rotation.from_quat(q[known], scalar_first=True) for q in (orientation, truth))
        x, y, z = (estimated * true.inv()).apply((0.0, 0.0, 1.0)).T
        error[known] = np.arctan2(np.hypot(x, y), z)
    return error


def inclination_rmse(orientation: np.ndarray, truth: np.ndarray, movement: np.ndarray | None = None) -> float:
    """Return the RMSE in rad over the samples that `movement` (n,) bool marks (default: all) and whose truth is known.

    NaN where there is no such sample.
    """
    error = inclination_error(orientation, truth)
    counted = np.isfinite(error) if movement is None else np.isfinite(error) & movement
    return float(np.sqrt(np.mean(error[counted] ** 2))) if counted.any() else float("nan")
