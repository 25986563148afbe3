"""Orientation of the robot's base in the world, from gravity only.

Gravity determines two of the three angles. The heading follows the smallest rotation from frame to frame (parallel transport),
and slowly returns the robot's axis to the world's x-z plane, which the camera shows from the side:

    R' = R_min(R g / |g| -> -e_z) R,    R'' = R_z(heading) R'.
"""

import math

import numpy as np
from scipy.spatial.transform import Rotation

PULL = 0.03  # part of the heading error that is removed at each frame
_DOWN = np.array([0.0, 0.0, -1.0])


class BaseInWorld:
    """Computes the rotation (3, 3) from soft_base to world from gravity (3,) in soft_base."""

    def __init__(self) -> None:
        # Horizontal, axis along x.
        self._rotation = Rotation.from_matrix([[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]])
        self._started = False

    def follow(self, gravity: np.ndarray) -> np.ndarray:
        """Return the rotation for this gravity; one that vanishes or is not finite changes nothing."""
        norm = float(np.linalg.norm(gravity))
        if not 1e-3 < norm < math.inf:
            return self._rotation.as_matrix()
        # For one pair of vectors scipy returns the smallest rotation.
        smallest, _ = Rotation.align_vectors(_DOWN, self._rotation.apply(gravity / norm))
        self._rotation = smallest * self._rotation
        axis = self._rotation.as_matrix()[:, 2]
        # Toward the nearer of x and -x; weaker near the vertical, where the axis has no heading.
        heading = math.atan2(axis[1], axis[0]) if axis[0] > 0 else math.atan2(-axis[1], -axis[0])
        level = float(axis[0] ** 2 + axis[1] ** 2)
        self._rotation = Rotation.from_euler("z", -heading * level * (PULL if self._started else 1.0)) * self._rotation
        self._started = True
        return self._rotation.as_matrix()


def quaternion_wxyz(rotation: np.ndarray) -> np.ndarray:
    """Return the quaternion (4,), w x y z, of a rotation (3, 3), w >= 0."""
    return Rotation.from_matrix(rotation).as_quat(canonical=True, scalar_first=True)
