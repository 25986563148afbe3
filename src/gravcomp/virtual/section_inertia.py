"""Inertia of a cross-section of the moving rod, compiled: its force, and its part of the tangent in the band."""

import numpy as np
from numba import njit


@njit(cache=True, error_model="numpy")
def add_inertia(
    residual: np.ndarray, velocity: np.ndarray, rate: np.ndarray, mass: float, centre: np.ndarray, inertia: np.ndarray
) -> None:
    """Add M rate - ad_v^T M v of one cross-section to residual (6,).

    mass in kg, its centre (3,) m, inertia (3, 3) kg m^2 about the axis. With the momenta
    P = m (v + w x c) and L = m c x v + J w the force is M rate + (w x P, w x L + v x P).
    """
    v0, v1, v2, w0, w1, w2 = velocity[0], velocity[1], velocity[2], velocity[3], velocity[4], velocity[5]
    c0, c1, c2 = centre[0], centre[1], centre[2]
    p0, p1, p2 = mass * (v0 + w1 * c2 - w2 * c1), mass * (v1 + w2 * c0 - w0 * c2), mass * (v2 + w0 * c1 - w1 * c0)
    q0 = mass * (c1 * v2 - c2 * v1) + inertia[0, 0] * w0 + inertia[0, 1] * w1 + inertia[0, 2] * w2
    q1 = mass * (c2 * v0 - c0 * v2) + inertia[1, 0] * w0 + inertia[1, 1] * w1 + inertia[1, 2] * w2
    q2 = mass * (c0 * v1 - c1 * v0) + inertia[2, 0] * w0 + inertia[2, 1] * w1 + inertia[2, 2] * w2
    residual[0] += mass * (rate[0] + rate[4] * c2 - rate[5] * c1) + w1 * p2 - w2 * p1
    residual[1] += mass * (rate[1] + rate[5] * c0 - rate[3] * c2) + w2 * p0 - w0 * p2
    residual[2] += mass * (rate[2] + rate[3] * c1 - rate[4] * c0) + w0 * p1 - w1 * p0
    residual[3] += mass * (c1 * rate[2] - c2 * rate[1]) + w1 * q2 - w2 * q1 + v1 * p2 - v2 * p1
    residual[4] += mass * (c2 * rate[0] - c0 * rate[2]) + w2 * q0 - w0 * q2 + v2 * p0 - v0 * p2
    residual[5] += mass * (c0 * rate[1] - c1 * rate[0]) + w0 * q1 - w1 * q0 + v0 * p1 - v1 * p0
    for i in range(3):
        for j in range(3):
            residual[3 + i] += inertia[i, j] * rate[3 + j]


@njit(cache=True, error_model="numpy")
def add_inertia_to_band(
    row: int, beta: float, mass: float, centre: np.ndarray, inertia: np.ndarray, middle: int, band: np.ndarray
) -> None:
    """Add beta M of one cross-section, whose first row is `row`, to the band."""
    m, x, y, z = beta * mass, beta * mass * centre[0], beta * mass * centre[1], beta * mass * centre[2]
    for i in range(3):
        band[row + i, middle] += m
        for j in range(3):
            band[row + 3 + i, middle + j - i] += beta * inertia[i, j]
    # The upper right block is -m c^, the lower left one its transpose.
    band[row, middle + 4] += z
    band[row, middle + 5] -= y
    band[row + 1, middle + 2] -= z
    band[row + 1, middle + 4] += x
    band[row + 2, middle + 1] += y
    band[row + 2, middle + 2] -= x
    band[row + 5, middle - 5] -= y
    band[row + 5, middle - 4] += x
    band[row + 3, middle - 2] -= z
    band[row + 3, middle - 1] += y
    band[row + 4, middle - 4] += z
    band[row + 4, middle - 2] -= x
