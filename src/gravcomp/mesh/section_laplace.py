"""Laplace's equation on a divided cross-section: nine-node quadrilaterals with biquadratic shape functions."""

import itertools

import numpy as np
from scipy import sparse


def stiffness_and_moments(
    cells: np.ndarray, place: np.ndarray, equal: bool = False
) -> tuple[sparse.csc_array, np.ndarray, float]:
    """Integrate over the cells (k, 3, 3) whose nodes lie at `place` (n, 2), in m.

    equal: the integrals of each cell are divided by its area, so that small cells are as stiff as large ones. Returns the matrix
    (n, n) of grad N_a . grad N_b; the vector (n,) of grad N_a . (y, -x); and the integral of x^2 + y^2.
    """
    nodes = cells.reshape(len(cells), 9)
    ends = place[cells[:, ::2, ::2]].reshape(-1, 4, 2)
    diagonals = ends[:, 3] - ends[:, 0], ends[:, 2] - ends[:, 1]
    whole = np.abs(diagonals[0][:, 0] * diagonals[1][:, 1] - diagonals[0][:, 1] * diagonals[1][:, 0]) / 2
    x, weight = np.polynomial.legendre.leggauss(3)
    count = len(place)
    rows, columns, values, load, polar = [], [], [], np.zeros(count), 0.0
    for (a, wa), (b, wb) in itertools.product(zip(x, weight), repeat=2):
        shape, by_a, by_b = _shape(a, b)
        here = place[nodes]  # (k, 9, 2)
        jacobian = np.stack([by_a @ here, by_b @ here], axis=1)  # (k, 2, 2): d(x, y) / d(a, b)
        area = np.abs(np.linalg.det(jacobian)) * wa * wb / (whole if equal else 1.0)
        gradient = np.linalg.solve(jacobian, np.broadcast_to(np.stack([by_a, by_b]), (len(cells), 2, 9)))
        point = shape @ here
        values.append((np.einsum("kia,kib->kab", gradient, gradient) * area[:, None, None]).ravel())
        rows.append(np.repeat(nodes, 9, axis=1).ravel())
        columns.append(np.tile(nodes, (1, 9)).ravel())
        turned = np.stack([point[:, 1], -point[:, 0]], axis=1)
        np.add.at(load, nodes, np.einsum("kia,ki->ka", gradient, turned) * area[:, None])
        polar += float(area @ (point**2).sum(axis=1))
    index = np.concatenate(rows), np.concatenate(columns)
    return sparse.coo_array((np.concatenate(values), index), shape=(count, count)).tocsc(), load, polar


def jacobian_ratios(cells: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Return the smallest over the largest Jacobian (k,) of each cell, at its nodes."""
    here = place[cells.reshape(len(cells), 9)]
    values = []
    for a, b in itertools.product((-1.0, 0.0, 1.0), repeat=2):
        _, by_a, by_b = _shape(a, b)
        values.append(np.linalg.det(np.stack([by_a @ here, by_b @ here], axis=1)))
    return np.min(values, axis=0) / np.max(values, axis=0)


def _shape(a: float, b: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Values (9,) of the shape functions, and their derivatives by a and b."""
    (fa, da), (fb, db) = _quadratic(a), _quadratic(b)
    return np.outer(fa, fb).ravel(), np.outer(da, fb).ravel(), np.outer(fa, db).ravel()


def _quadratic(t: float) -> tuple[np.ndarray, np.ndarray]:
    return np.array([t * (t - 1) / 2, 1 - t * t, t * (t + 1) / 2]), np.array([t - 0.5, -2 * t, t + 0.5])
