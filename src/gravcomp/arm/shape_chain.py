"""The deformed robot as a chain of joints, as the macro of the URDF has it: each piece points to the next point of the backbone.

    p_i = p_(i-1) + R_i (0, 0, l_0 + z_i),    R_i = R_(i-1) Rx(x_i) Ry(y_i)

x_i and y_i (rad) bend, z_i (m) stretches the piece of the rest length l_0.
"""

import math

import numpy as np

from gravcomp.arm.chain import turn

_AXES = ("x", "y", "z")  # ends of the names of the joints of a piece
_X, _Y, _ = np.eye(3)


def joint_names(prefix: str, points: int) -> list[str]:
    """Return the names of the joints of a backbone with this number of points."""
    return [f"{prefix}chain_{i}_{axis}" for i in range(1, points) for axis in _AXES]


def joint_positions(backbone: np.ndarray, length: float) -> list[float]:
    """Return the positions of the joints, in the order of `joint_names`.

    backbone (k, 3): points in soft_base, in m; length: of the robot at rest, in m.
    """
    rest, rotation, result = length / (len(backbone) - 1), np.eye(3), []
    for step in np.diff(backbone, axis=0):
        dx, dy, dz = rotation.T @ step
        size = math.sqrt(dx * dx + dy * dy + dz * dz)
        bend_x, bend_y = math.atan2(-dy, dz), math.asin(min(1.0, max(-1.0, dx / size))) if size > 0.0 else 0.0
        result += [bend_x, bend_y, size - rest]
        rotation = rotation @ turn(_X, bend_x) @ turn(_Y, bend_y)
    return result
