"""What the length of the specific force at rest tells about the accelerometer: three numbers of a bias, from a few orientations.

At rest the true specific force is as long as gravity. Measured along the unit vector n, it is longer by

    |f| - g = n b + g sum_i s_i n_i^2 + noise

with the bias b and relative errors s of the scales of the IMU's axes, which also stand for local gravity. A mount that is turned
does not change a length: so this tells both apart, where tips hardly do. Opposite orientations tell n b without the scales. The
scales are not fitted; their prior makes the rows of different orientations alike.
"""

from collections.abc import Sequence

import numpy as np

from gravcomp.calibration.estimates import IMPLAUSIBLE
from gravcomp.calibration.measured import StillWindows
from gravcomp.calibration.unknowns import Priors, Unknown
from gravcomp.orientation.calibration import POSE_NOISE


def bias_rows(gravity: np.ndarray, unknowns: Sequence[Unknown]) -> np.ndarray:
    """Return the derivatives (k, u) in m/s^2 of the lengths by x, for measured gravity (k, 3)."""
    along = _along(gravity)
    rows = [along[:, u.index[0]] * u.scale if u.kind == "bias" else np.zeros(len(along)) for u in unknowns]
    return np.column_stack(rows)


def scale_rows(gravity: np.ndarray, mount: np.ndarray, priors: Priors) -> np.ndarray:
    """Return those (k, 3) by the scales of the IMU's axes over their prior's deviation; mount (3, 3): of the IMU in soft_base."""
    return np.asarray(priors.scale * np.linalg.norm(gravity, axis=1)[:, None] * (_along(gravity) @ mount) ** 2)


def implausible_length(windows: StillWindows, priors: Priors) -> str:
    """Return why the lengths cannot be those of a calibrated accelerometer, empty where they can, or were not measured."""
    known = _with_lengths(windows)
    if not known.any():
        return ""
    assert windows.specific_force is not None  # it has numbers
    gravity = np.linalg.norm(windows.gravity, axis=1)
    away = windows.specific_force - gravity
    worst = int(np.nanargmax(np.abs(away)))
    most = IMPLAUSIBLE * float(np.hypot(priors.bias, priors.scale * gravity[worst]))
    if abs(away[worst]) <= most:
        return ""
    return (
        f"the specific force at rest is {windows.specific_force[worst]:.2f} m/s^2 long; {gravity[worst]:.2f} ± {most:.2f} is"
        " expected of a calibrated accelerometer. Its length is not used: ./gravcomp calibrate-imu first"
    )


def length_rows(
    windows: StillWindows, unknowns: Sequence[Unknown], mount: np.ndarray, priors: Priors
) -> tuple[np.ndarray, np.ndarray]:
    """Return rows (k, u) and what is expected of them (k,), over their deviations and independent of each other.

    One for each window with a length. None (k = 0) where these are implausible, or no bias is among the unknowns.
    """
    known = _with_lengths(windows)
    if not known.any() or not any(unknown.kind == "bias" for unknown in unknowns) or implausible_length(windows, priors):
        return np.zeros((0, len(unknowns))), np.zeros(0)
    assert windows.specific_force is not None  # it has numbers
    gravity = windows.gravity[known]
    scales = scale_rows(gravity, mount, priors)
    covariance = np.diag(POSE_NOISE**2 / windows.shares[known]) + scales @ scales.T
    longer = windows.specific_force[known] - np.linalg.norm(gravity, axis=1)
    found = np.column_stack([bias_rows(gravity, unknowns), longer])
    white = np.linalg.solve(np.linalg.cholesky(covariance), found)
    return white[:, :-1], white[:, -1]


def _with_lengths(windows: StillWindows) -> np.ndarray:
    """Return (k,) whether the length of a window was measured."""
    force = windows.specific_force
    return np.zeros(len(windows.gravity), dtype=bool) if force is None else np.isfinite(force)


def _along(gravity: np.ndarray) -> np.ndarray:
    """Return the directions (k, 3) of the specific force."""
    return np.asarray(-gravity / np.linalg.norm(gravity, axis=1, keepdims=True))
