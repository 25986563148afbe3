"""The axes of the world in those of the robot's base, from gravity there."""

import numpy as np
from numba import njit


def world_rotation(gravity: np.ndarray) -> np.ndarray:
    """Return the rotation (3, 3) from soft_base to the world for gravity (3,) in soft_base.

    Gravity fixes it but for the turn about the vertical. The world is that of a horizontal robot, whose x axis points up and
    whose z axis is the world's x axis, turned by the shortest way to this gravity; without gravity, that of the horizontal robot.
    """
    rotation: np.ndarray = _world_rotation(float(gravity[0]), float(gravity[1]), float(gravity[2]))
    return rotation


@njit(cache=True)
def _world_rotation(down_x: float, down_y: float, down_z: float) -> np.ndarray:
    """Compiled `world_rotation`: it is asked for in every step, and small products of arrays take thirty times as long."""
    size = np.sqrt(down_x**2 + down_y**2 + down_z**2)
    x, y, z = 1.0, 0.0, 0.0  # up
    if size > 0.0:
        x, y, z = -down_x / size, -down_y / size, -down_z / size
    if x < -1.0 + 1e-12:  # any axis across it would do
        return np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    # 1 + C + C^2 / (1 + x) with the cross product C of up and the x axis, then the axes of a horizontal robot.
    part = 1.0 / (1.0 + x)
    return np.array([[-z, -y * z * part, 1.0 - z * z * part], [y, y * y * part - 1.0, y * z * part], [x, y, z]])
