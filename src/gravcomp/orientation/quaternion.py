"""Unit quaternions w x y z, Hamilton's product, as tuples of Python floats; for one sample at a time this is the fastest form.

q = (cos(t/2), sin(t/2) axis) rotates vectors from the sensor's to the earth's frame: v_earth = R(q) v_sensor. For arrays of
rotations scipy.spatial.transform.Rotation is used instead.
"""

import math
from collections.abc import Sequence

import numpy as np

Quaternion = tuple[float, float, float, float]
Vector = tuple[float, float, float]
IDENTITY: Quaternion = (1.0, 0.0, 0.0, 0.0)


def multiply(a: Sequence[float], b: Sequence[float]) -> Quaternion:
    """Return the product a b: the rotation b, then the rotation a."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def conjugate(q: Sequence[float]) -> Quaternion:
    """Return the inverse rotation."""
    return (q[0], -q[1], -q[2], -q[3])


def exponential(x: float, y: float, z: float) -> Quaternion:
    """Return the rotation by the rotation vector (x, y, z), rad."""
    angle_squared = x * x + y * y + z * z
    if angle_squared < 1e-8:
        scale = 0.5 - angle_squared / 48.0
        real = 1.0 - angle_squared / 8.0
    else:
        angle = math.sqrt(angle_squared)
        scale = math.sin(0.5 * angle) / angle
        real = math.cos(0.5 * angle)
    return (real, scale * x, scale * y, scale * z)


def normalised(q: Sequence[float]) -> Quaternion:
    """Return q / |q|."""
    w, x, y, z = q
    scale = 1.0 / math.sqrt(w * w + x * x + y * y + z * z)
    return (w * scale, x * scale, y * scale, z * scale)


def rotate(q: Sequence[float], vector: Sequence[float]) -> Vector:
    """Return R(q) vector."""
    w, x, y, z = q
    a, b, c = vector
    tx, ty, tz = 2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)
    return (a + w * tx + y * tz - z * ty, b + w * ty + z * tx - x * tz, c + w * tz + x * ty - y * tx)


def matrix(q: Sequence[float]) -> np.ndarray:
    """Return R(q), (3, 3)."""
    w, x, y, z = q
    return np.array(
        (
            (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)),
            (2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)),
            (2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)),
        )
    )


def from_roll_pitch_yaw(roll: float, pitch: float, yaw: float) -> Quaternion:
    """Return the rotation by roll about x, then pitch about y, then yaw about z, all in the fixed frame (REP-103), rad.

    >>> quarter_turn = from_roll_pitch_yaw(0.0, 0.0, math.pi / 2)
    >>> [round(component, 3) for component in rotate(quarter_turn, (1.0, 0.0, 0.0))]
    [0.0, 1.0, 0.0]
    """
    cr, sr = math.cos(0.5 * roll), math.sin(0.5 * roll)
    cp, sp = math.cos(0.5 * pitch), math.sin(0.5 * pitch)
    cy, sy = math.cos(0.5 * yaw), math.sin(0.5 * yaw)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def level(accel: Sequence[float], yaw: float = 0.0) -> Quaternion:
    """Return the orientation of a sensor at rest that measures this specific force, with the given yaw (rad)."""
    x, y, z = accel
    return from_roll_pitch_yaw(math.atan2(y, z), math.atan2(-x, math.hypot(y, z)), yaw)


def yaw_of(q: Sequence[float]) -> float:
    """Return the yaw of q (of roll, pitch, yaw), rad."""
    w, x, y, z = q
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
