"""Orientation of the robot's base in the world, from gravity only.

Gravity determines two of the three angles. The heading follows the smallest rotation from frame to frame (parallel transport),
and slowly returns the robot's axis to the world's x-z plane, which the camera shows from the side:

    R' = R_min(R g / |g| -> -e_z) R,    R'' = R_z(heading) R'.
"""

import math

import numpy as np

PULL = 0.03  # part of the heading error that is removed at each frame


class BaseInWorld:
    """Computes the rotation (3, 3) from soft_base to world from gravity (3,) in soft_base."""

    def __init__(self) -> None:
        # Horizontal, axis along x.
        self.rotation = np.array([[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]])
        self._started = False

    def follow(self, gravity: np.ndarray) -> np.ndarray:
        """Return the rotation for this gravity; a vanishing one changes nothing."""
        norm = float(np.linalg.norm(gravity))
        if norm < 1e-3:
            return self.rotation
        self.rotation = _least_turn(self.rotation @ gravity / norm, np.array([0.0, 0.0, -1.0])) @ self.rotation
        axis = self.rotation[:, 2]
        # Toward the nearer of x and -x; weaker near the vertical, where the axis has no heading.
        heading = math.atan2(axis[1], axis[0]) if axis[0] > 0 else math.atan2(-axis[1], -axis[0])
        level = float(axis[0] ** 2 + axis[1] ** 2)
        self.rotation = _about_z(-heading * level * (PULL if self._started else 1.0)) @ self.rotation
        self._started = True
        return self.rotation


def quaternion_wxyz(rotation: np.ndarray) -> np.ndarray:
    """Return the quaternion (4,), w x y z, of a rotation (3, 3)."""
    m = rotation
    k = np.array([
        [m[0, 0] - m[1, 1] - m[2, 2], 0, 0, 0],
        [m[0, 1] + m[1, 0], m[1, 1] - m[0, 0] - m[2, 2], 0, 0],
        [m[0, 2] + m[2, 0], m[1, 2] + m[2, 1], m[2, 2] - m[0, 0] - m[1, 1], 0],
        [m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], m[0, 0] + m[1, 1] + m[2, 2]],
    ])  # fmt: skip
    # Bar-Itzhack (2000): the quaternion is the eigenvector of the largest eigenvalue.
    x, y, z, w = np.linalg.eigh(k)[1][:, -1]
    return np.array([w, x, y, z]) * (1.0 if w >= 0 else -1.0)


def _least_turn(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the smallest rotation (3, 3) from the unit vector a to b."""
    v, c = np.cross(a, b), float(a @ b)
    if c < -1.0 + 1e-9:
        return np.diag([1.0, -1.0, -1.0])
    k = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    return np.eye(3) + k + k @ k / (1.0 + c)


def _about_z(angle: float) -> np.ndarray:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
