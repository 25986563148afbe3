"""Rotations and rigid motions as the rod needs them, compiled.

Twists are (translation, rotation): xi = (v, w), and exp(xi) = (V(w) v, exp(w^)) with V the left Jacobian of SO(3). The inverse
right Jacobian of SE(3), J_r^-1(xi) = I + ad/2 + ad^2/12 - ..., is truncated after the second power: the elements of the rod turn
by less than 0.2 rad, where the next term is below 3e-6. (J. Sola, J. Deray, D. Atchuthan, "A micro Lie theory for state
estimation in robotics", 2018; V. Sonneville, A. Cardona, O. Bruls, "Geometrically exact beam finite element formulated on the
special Euclidean group SE(3)", CMAME 268, 2014.)
"""

import math

import numpy as np
from numba import njit


@njit(cache=True, error_model="numpy")
def rotation_exp(w: np.ndarray, out: np.ndarray) -> None:
    """Write the rotation matrix exp(w^) of the rotation vector w (3,) in rad to out (3, 3)."""
    angle2 = w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
    angle = math.sqrt(angle2)
    if angle < 1e-4:
        a, b = 1.0 - angle2 / 6.0, 0.5 - angle2 / 24.0
    else:
        a, b = math.sin(angle) / angle, (1.0 - math.cos(angle)) / angle2
    for i in range(3):
        for j in range(3):
            out[i, j] = b * w[i] * w[j]
        out[i, i] += 1.0 - b * angle2
    out[0, 1] -= a * w[2]
    out[0, 2] += a * w[1]
    out[1, 0] += a * w[2]
    out[1, 2] -= a * w[0]
    out[2, 0] -= a * w[1]
    out[2, 1] += a * w[0]


@njit(cache=True, error_model="numpy")
def rotation_log(r: np.ndarray, out: np.ndarray) -> None:
    """Write the rotation vector of the rotation r (3, 3) to out (3,), |out| <= pi rad."""
    s0, s1, s2 = r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]
    sine = 0.5 * math.sqrt(s0 * s0 + s1 * s1 + s2 * s2)
    cosine = 0.5 * (r[0, 0] + r[1, 1] + r[2, 2] - 1.0)
    if cosine < -0.99:
        _rotation_log_near_pi(r, out)
        return
    angle = math.atan2(sine, cosine)
    factor = 0.5 * (1.0 + angle * angle / 6.0) if sine < 1e-4 else 0.5 * angle / sine
    out[0], out[1], out[2] = factor * s0, factor * s1, factor * s2


@njit(cache=True, error_model="numpy")
def rotation_to_quaternion(r: np.ndarray, out: np.ndarray) -> None:
    """Write the quaternion x y z w of the rotation r (3, 3) to out (4,), w >= 0.

    The largest component follows from the diagonal, the others from sums and differences of entries (Shepperd).
    """
    trace = r[0, 0] + r[1, 1] + r[2, 2]
    k = 3
    largest = trace
    for i in range(3):
        if r[i, i] > largest:
            k, largest = i, r[i, i]
    if k == 3:
        out[0], out[1], out[2], out[3] = r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1], 1.0 + trace
    else:
        i, j = (k + 1) % 3, (k + 2) % 3
        out[k] = 1.0 + r[k, k] - r[i, i] - r[j, j]
        out[i] = r[i, k] + r[k, i]
        out[j] = r[j, k] + r[k, j]
        out[3] = r[j, i] - r[i, j]
    norm = math.sqrt(out[0] ** 2 + out[1] ** 2 + out[2] ** 2 + out[3] ** 2)
    if out[3] < 0.0:
        norm = -norm
    for i in range(4):
        out[i] /= norm


@njit(cache=True, error_model="numpy")
def motion_exp(xi: np.ndarray, rotation: np.ndarray, translation: np.ndarray) -> None:
    """Write exp(xi) of the twist xi (6,) to rotation (3, 3) and translation (3,)."""
    w0, w1, w2 = xi[3], xi[4], xi[5]
    rotation_exp(xi[3:], rotation)
    angle2 = w0 * w0 + w1 * w1 + w2 * w2
    angle = math.sqrt(angle2)
    if angle < 1e-3:
        b, c = 0.5 - angle2 / 24.0, 1.0 / 6.0 - angle2 / 120.0
    else:
        b, c = (1.0 - math.cos(angle)) / angle2, (angle - math.sin(angle)) / (angle2 * angle)
    v0, v1, v2 = xi[0], xi[1], xi[2]
    c0, c1, c2 = w1 * v2 - w2 * v1, w2 * v0 - w0 * v2, w0 * v1 - w1 * v0
    translation[0] = v0 + b * c0 + c * (w1 * c2 - w2 * c1)
    translation[1] = v1 + b * c1 + c * (w2 * c0 - w0 * c2)
    translation[2] = v2 + b * c2 + c * (w0 * c1 - w1 * c0)


@njit(cache=True, error_model="numpy")
def motion_log(rotation: np.ndarray, translation: np.ndarray, out: np.ndarray) -> None:
    """Write the twist whose exponential is (rotation (3, 3), translation (3,)) to out (6,)."""
    rotation_log(rotation, out[3:])
    w0, w1, w2 = out[3], out[4], out[5]
    angle2 = w0 * w0 + w1 * w1 + w2 * w2
    angle = math.sqrt(angle2)
    if angle < 1e-3:
        c = 1.0 / 12.0 + angle2 / 720.0
    else:
        half = 0.5 * angle
        c = (1.0 - half * math.cos(half) / math.sin(half)) / angle2
    v0, v1, v2 = translation[0], translation[1], translation[2]
    c0, c1, c2 = w1 * v2 - w2 * v1, w2 * v0 - w0 * v2, w0 * v1 - w1 * v0
    out[0] = v0 - 0.5 * c0 + c * (w1 * c2 - w2 * c1)
    out[1] = v1 - 0.5 * c1 + c * (w2 * c0 - w0 * c2)
    out[2] = v2 - 0.5 * c2 + c * (w0 * c1 - w1 * c0)


@njit(cache=True, error_model="numpy")
def advance(orientation: np.ndarray, position: np.ndarray, turn: np.ndarray, shift: np.ndarray, work: np.ndarray) -> None:
    """Move the pose (orientation (3, 3), position (3,)) in its own frame by (turn, shift), in place; work (3, 3) is scratch."""
    for i in range(3):
        position[i] += orientation[i, 0] * shift[0] + orientation[i, 1] * shift[1] + orientation[i, 2] * shift[2]
        for j in range(3):
            work[i, j] = orientation[i, 0] * turn[0, j] + orientation[i, 1] * turn[1, j] + orientation[i, 2] * turn[2, j]
    for i in range(3):
        for j in range(3):
            orientation[i, j] = work[i, j]


@njit(cache=True, error_model="numpy")
def copy_pose(orientation: np.ndarray, position: np.ndarray, to_orientation: np.ndarray, to_position: np.ndarray) -> None:
    """Copy a pose (orientation (3, 3), position (3,)); element by element, because slices take Numba seconds to compile."""
    for i in range(3):
        to_position[i] = position[i]
        for j in range(3):
            to_orientation[i, j] = orientation[i, j]


@njit(cache=True, error_model="numpy")
def inverse_jacobians(xi: np.ndarray, left: np.ndarray, right: np.ndarray) -> None:
    """Write the inverse left and right Jacobians of SE(3) at the twist xi (6,) to left and right (6, 6)."""
    ad = np.zeros((6, 6))
    _fill_cross(xi[3:], ad[:3, :3])
    _fill_cross(xi[3:], ad[3:, 3:])
    _fill_cross(xi[:3], ad[:3, 3:])
    for i in range(6):
        for j in range(6):
            square = 0.0
            for k in range(6):
                square += ad[i, k] * ad[k, j]
            even = square / 12.0 + (1.0 if i == j else 0.0)
            left[i, j] = even - 0.5 * ad[i, j]
            right[i, j] = even + 0.5 * ad[i, j]


@njit(cache=True, error_model="numpy")
def _fill_cross(w: np.ndarray, out: np.ndarray) -> None:
    out[0, 1], out[0, 2], out[1, 2] = -w[2], w[1], -w[0]
    out[1, 0], out[2, 0], out[2, 1] = w[2], -w[1], w[0]


@njit(cache=True, error_model="numpy")
def _rotation_log_near_pi(r: np.ndarray, out: np.ndarray) -> None:
    # The antisymmetric part vanishes at pi; the axis is the column of r + 1 with the largest diagonal entry.
    k = 0
    for i in range(1, 3):
        if r[i, i] > r[k, k]:
            k = i
    axis = np.empty(3)
    for i in range(3):
        axis[i] = r[i, k] + r[k, i]
    axis[k] += 1.0 - (r[0, 0] + r[1, 1] + r[2, 2])
    norm = math.sqrt(axis[0] ** 2 + axis[1] ** 2 + axis[2] ** 2)
    s0, s1, s2 = r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]
    sign = -1.0 if axis[0] * s0 + axis[1] * s1 + axis[2] * s2 < 0.0 else 1.0
    sine = 0.5 * math.sqrt(s0 * s0 + s1 * s1 + s2 * s2)
    angle = math.atan2(sine, 0.5 * (r[0, 0] + r[1, 1] + r[2, 2] - 1.0))
    for i in range(3):
        out[i] = sign * angle * axis[i] / norm


@njit(cache=True, error_model="numpy")
def orthonormalise(rotation: np.ndarray, work: np.ndarray) -> None:
    """Bring rotation (3, 3) to the nearest rotation by one Newton step, R (3 - R^T R) / 2; work (3, 3) is scratch.

    This keeps rounding errors from adding up over hours.
    """
    for i in range(3):
        for j in range(3):
            product = 0.0
            for k in range(3):
                product += rotation[k, i] * rotation[k, j]
            work[i, j] = (1.5 if i == j else 0.0) - 0.5 * product
    for i in range(3):
        a, b, c = rotation[i, 0], rotation[i, 1], rotation[i, 2]
        for j in range(3):
            rotation[i, j] = a * work[0, j] + b * work[1, j] + c * work[2, j]
