"""How far an estimated orientation's direction of gravity is from the true one, by BROAD's protocol.

With e = q conj(q_true) in the earth's frame the inclination error is 2 acos(sqrt(e_w^2 + e_z^2)): what remains of e when
its yaw is taken out.
"""

import numpy as np


def inclination_error(orientation: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Error of each sample, (n,) rad; both (n, 4) w x y z, sensor to earth; NaN where one of them is."""
    w, x, y, z = orientation.T
    tw, tx, ty, tz = truth.T
    error_w = w * tw + x * tx + y * ty + z * tz
    error_z = -w * tz + z * tw - x * ty + y * tx
    error_xy = np.sqrt(np.maximum(1.0 - error_w**2 - error_z**2, 0.0))
    # The same angle as 2 acos(sqrt(w^2 + z^2)), without its loss of digits near zero.
    return 2.0 * np.arctan2(error_xy, np.hypot(error_w, error_z))


def inclination_rmse(orientation: np.ndarray, truth: np.ndarray, movement: np.ndarray | None = None) -> float:
    """RMSE over the samples marked by `movement` (n,) (default: all) where the truth is known, rad. NaN: there is none."""
    error = inclination_error(orientation, truth)
    counted = np.isfinite(error) if movement is None else np.isfinite(error) & movement
    return float(np.sqrt(np.mean(error[counted] ** 2))) if counted.any() else float("nan")
