"""Gravity from IMU and arm together.

The IMU's gravity u has the right time, the arm's gravity v has no drift. With the rotation vector e that turns u into v, averaged
over `AVERAGE`, the fused gravity is u turned by

    s e,    s = sigma_imu^2 / (sigma_imu^2 + sigma_arm^2)

which is the mean weighted by the variances. Where they disagree by more than the tolerance for longer than the patience, one of
them is wrong, and the IMU counts alone: it is on the robot. Without one of them the other counts alone.
"""

import math

import numpy as np
from scipy.spatial.transform import Rotation

from gravcomp.arm.chain import angle_between
from gravcomp.standard_gravity import STANDARD_GRAVITY

AVERAGE = 1.0
"""s, time constant of the mean difference."""


class GravityFusion:
    """Fuses gravity; angles in rad, times in s (monotonic), gravity (3,) in m/s^2 in the same frame.

    Attributes: angle (the last difference, None before the first), disagrees (for longer than the patience).
    """

    def __init__(self, imu_std: float, arm_std: float, tolerance: float, patience: float, stale: float):
        self._stale = stale
        self.trust(imu_std, arm_std, tolerance, patience)
        self._arm: tuple[float, np.ndarray] | None = None
        self._imu_time = -math.inf
        self._mean: np.ndarray | None = None
        self._agreed = -math.inf
        self.angle: float | None = None
        self.disagrees = False

    def trust(self, imu_std: float, arm_std: float, tolerance: float, patience: float) -> None:
        """Set how far each is trusted; what was measured so far stays."""
        self._share = imu_std**2 / (imu_std**2 + arm_std**2)
        self._tolerance, self._patience = tolerance, patience

    def imu(self, time: float, gravity: np.ndarray) -> np.ndarray:
        """Take the IMU's gravity; return the fused one."""
        elapsed, self._imu_time = time - self._imu_time, time
        if self._arm is None or time - self._arm[0] > self._stale:
            self._mean, self.angle, self.disagrees = None, None, False
            return gravity
        unit = gravity / np.linalg.norm(gravity)
        difference = _turn(unit, self._arm[1])
        self.angle = float(np.linalg.norm(difference))
        if self.angle <= self._tolerance or self._agreed == -math.inf:
            self._agreed = time
        self.disagrees = time - self._agreed > self._patience
        if self._mean is None:
            self._mean = difference
        else:
            self._mean = self._mean + min(1.0, max(elapsed, 0.0) / AVERAGE) * (difference - self._mean)
        if self.disagrees:
            return gravity
        return STANDARD_GRAVITY * Rotation.from_rotvec(self._share * self._mean).apply(unit)

    def arm(self, time: float, gravity: np.ndarray) -> np.ndarray | None:
        """Take the arm's gravity; return it where there is no IMU, else None."""
        self._arm = time, gravity / np.linalg.norm(gravity)
        return gravity if time - self._imu_time > self._stale else None


def _turn(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Return the shortest rotation vector (3,) that turns one unit vector into another."""
    axis = np.cross(start, end)
    length = float(np.linalg.norm(axis))
    return np.zeros(3) if length < 1e-12 else axis / length * angle_between(start, end)
