"""The drawn part of a plane: a square of cells, so that a picture that bends straight edges can show it."""

import numpy as np

_PATCH = 1.6  # side, in lengths of the robot
_CELLS = 16  # along a side


def plane_patch(side: float) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices (v, 3) and faces of a square of this side (m) in the x-y plane, which faces along z."""
    place = np.linspace(-side / 2, side / 2, _CELLS + 1)
    x, y = (grid.ravel() for grid in np.meshgrid(place, place, indexing="ij"))
    i, j = (grid.ravel() for grid in np.meshgrid(np.arange(_CELLS), np.arange(_CELLS), indexing="ij"))
    a = i * (_CELLS + 1) + j
    b, c, d = a + _CELLS + 1, a + 1, a + _CELLS + 2
    return np.stack([x, y, 0.0 * x], axis=1), np.concatenate([np.stack([a, b, d], 1), np.stack([a, d, c], 1)])


def patch_side(length: float) -> float:
    """Return the side (m) of the square by which a plane next to a robot of `length` (m) is drawn."""
    return _PATCH * length


def plane_foot(normal: np.ndarray, point: np.ndarray, middle: np.ndarray) -> np.ndarray:
    """Return the place (3,) m on a plane next to `middle` (3,) m, where its drawn part has its middle."""
    return middle - normal @ (middle - point) * normal


def plane_wxyz(normal: np.ndarray) -> np.ndarray:
    """Return the quaternion (4,), w x y z, of the smallest rotation from z to a unit vector (3,): it turns the drawn part."""
    x, y, z = normal
    if z < -1.0 + 1e-9:
        return np.array([0.0, 1.0, 0.0, 0.0])
    q = np.array([1.0 + z, -y, x, 0.0])
    return q / np.linalg.norm(q)
