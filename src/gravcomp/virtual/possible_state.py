"""Bounds that every state of the moving rod keeps, compiled: a step that passes them has not found the motion."""

import numpy as np
from numba import njit

_LARGEST_TURN = 1.5  # rad in one element
_LARGEST_VELOCITY = 2e3  # m/s and rad/s


@njit(cache=True, error_model="numpy")
def is_possible(
    orientation: np.ndarray, position: np.ndarray, strain: np.ndarray, velocity: np.ndarray, length: np.ndarray
) -> bool:
    """Return whether pose, strain and velocity are within physical bounds; written so that NaN is not possible."""
    reach = 2.0 * np.sum(length)
    possible = True
    for k in range(orientation.shape[0]):
        for i in range(3):
            possible = possible and abs(position[k, i] - position[0, i]) < reach
            for j in range(3):
                possible = possible and abs(orientation[k, i, j]) < 1.0 + 1e-6
        for i in range(6):
            possible = possible and abs(velocity[k, i]) < _LARGEST_VELOCITY
    for e in range(length.shape[0]):
        for i in range(3, 6):
            possible = possible and abs(strain[e, i]) * length[e] < _LARGEST_TURN
    return possible
