"""Positions and orientations of tip and backbone from cross-sections, with derivatives. Compiled, because it runs in every step.

A section is p, f_1, f_2 (`mesh.sections`). Its z axis is d = f_1 x f_2 / |f_1 x f_2|. Its x axis halves the angle between f_1
and f_2 x d, so that x and y are as near to f_1 and f_2 as a rotation allows.
"""

import numpy as np
from numba import njit


@njit(cache=True)
def observe(sections: np.ndarray, moved: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return effector rows (6 + 3 n,), their changes (6 + 3 n, k) and quaternions (n + 1, 4) x y z w.

    sections (n + 1, 3, 3): p, f_1, f_2 of every backbone point and, last, of the tip; moved (n + 1, 3, 3, k): their changes.
    The rows are tip position, tip direction, backbone positions.
    """
    count, columns = sections.shape[0] - 1, moved.shape[3]
    values = np.empty(6 + 3 * count)
    change = np.empty((6 + 3 * count, columns))
    orientation = np.empty((count + 1, 4))
    d = np.empty(3)
    for s in range(count + 1):
        _cross(sections[s, 1], sections[s, 2], d)
        length = _normalise(d)
        _quaternion(sections[s, 1], sections[s, 2], d, orientation[s])
        row = 6 + 3 * s if s < count else 0
        for i in range(3):
            values[row + i] = sections[s, 0, i]
            change[row + i] = moved[s, 0, i]
    for i in range(3):
        values[3 + i] = d[i]
    tip, f1, f2 = moved[count], sections[count, 1], sections[count, 2]
    turned = np.empty(3)
    for k in range(columns):
        for i in range(3):
            a, b = (i + 1) % 3, (i + 2) % 3
            turned[i] = tip[1, a, k] * f2[b] - tip[1, b, k] * f2[a] + f1[a] * tip[2, b, k] - f1[b] * tip[2, a, k]
        along = d[0] * turned[0] + d[1] * turned[1] + d[2] * turned[2]
        for i in range(3):
            change[3 + i, k] = (turned[i] - d[i] * along) / length
    return values, change, orientation


@njit(cache=True)
def _cross(a: np.ndarray, b: np.ndarray, out: np.ndarray) -> None:
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@njit(cache=True)
def _normalise(a: np.ndarray) -> float:
    """Scale a (3,) to length 1 and return its length before."""
    length = np.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
    for i in range(3):
        a[i] /= length
    return length


@njit(cache=True)
def _quaternion(f1: np.ndarray, f2: np.ndarray, z: np.ndarray, out: np.ndarray) -> None:
    """Write the quaternion (4,) x y z w of a section with f_1, f_2 and the axis z."""
    x, y, other = f1.copy(), f2.copy(), np.empty(3)
    _normalise(x)
    _normalise(y)
    _cross(y, z, other)
    for i in range(3):
        x[i] += other[i]
    _normalise(x)
    _cross(z, x, y)
    # Shepperd's method starts from the largest of the four squares.
    squares = (1 + x[0] - y[1] - z[2], 1 - x[0] + y[1] - z[2], 1 - x[0] - y[1] + z[2], 1 + x[0] + y[1] + z[2])
    largest = 0
    for i in range(1, 4):
        if squares[i] > squares[largest]:
            largest = i
    if largest == 0:
        out[0], out[1], out[2], out[3] = squares[0], x[1] + y[0], x[2] + z[0], y[2] - z[1]
    elif largest == 1:
        out[0], out[1], out[2], out[3] = x[1] + y[0], squares[1], y[2] + z[1], z[0] - x[2]
    elif largest == 2:
        out[0], out[1], out[2], out[3] = x[2] + z[0], y[2] + z[1], squares[2], x[1] - y[0]
    else:
        out[0], out[1], out[2], out[3] = y[2] - z[1], z[0] - x[2], x[1] - y[0], squares[3]
    length = np.sqrt(out[0] ** 2 + out[1] ** 2 + out[2] ** 2 + out[3] ** 2)
    if out[3] < 0.0:  # choose the quaternion with positive w
        length = -length
    for i in range(4):
        out[i] /= length
