"""Local coordinates of points in elements: the inverse of the isoparametric map, by a damped Newton iteration.

The map of a quadratic element is not linear, and far from the element it may be singular or fold over. So the iteration starts
from several places, a step is halved until it brings the point nearer, and the result says how far the point found lies
from the point sought. Only a solution where the map keeps its orientation counts.
"""

import numpy as np

from gravcomp.mesh.elements import centre, distance_outside, reference_nodes, shape_gradients, shape_values

# Local coordinates farther outside than this are not followed: the map of an element means nothing there.
_FARTHEST = 2.0
_ITERATIONS, _HALVINGS = 40, 8
STARTS = 3


def local_coordinates(
    kind: str, corners: np.ndarray, points: np.ndarray, tolerance: float, attempt: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find points (p, 3) in elements with the nodes (p, c, 3), one element a point, from the start number `attempt` (< STARTS).

    Returns local coordinates (p, 3), the distance (p,) in m from the point found there to the point sought, and whether it was
    found (p,): the distance is at most `tolerance` (m), and the map keeps its orientation there.
    """
    return local_coordinates_from(kind, corners, points, tolerance, _best_start(kind, corners, points, _starts(kind), attempt))


def local_coordinates_from(
    kind: str, corners: np.ndarray, points: np.ndarray, tolerance: float, start: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find points as `local_coordinates` does, from the local coordinates `start` (p, 3)."""
    local, distance = _newton(kind, corners, points, start, tolerance)
    found = distance <= tolerance
    found[found] = np.linalg.det(_jacobian(kind, corners[found], local[found])) > 0.0
    return local, distance, found


def _starts(kind: str) -> np.ndarray:
    """(s, 3) places to start from: the middle, and points between it and every node."""
    middle = centre(kind)
    return np.vstack([middle, middle + 0.6 * (reference_nodes(kind) - middle)])


def _best_start(kind: str, corners: np.ndarray, points: np.ndarray, trial: np.ndarray, attempt: int) -> np.ndarray:
    """(p, 3): the middle first, then the places whose images are nearest to the points."""
    if attempt == 0:
        return np.tile(trial[0], (len(points), 1))
    images = shape_values(kind, trial) @ corners  # (p, s, 3)
    order = np.argsort(((images - points[:, None, :]) ** 2).sum(axis=2), axis=1)
    return trial[order[:, attempt - 1]]


def _newton(
    kind: str, corners: np.ndarray, points: np.ndarray, start: np.ndarray, tolerance: float
) -> tuple[np.ndarray, np.ndarray]:
    """Local coordinates (p, 3) reached from `start` (p, 3), and the distance (p,) that remains."""
    local = start.copy()
    misfit = points - _image(kind, corners, local)
    distance = np.linalg.norm(misfit, axis=1)
    moving = np.arange(len(points))
    for _ in range(_ITERATIONS):
        moving = moving[distance[moving] > 0.01 * tolerance]
        if not len(moving):
            break
        jacobian = _jacobian(kind, corners[moving], local[moving])
        size = np.linalg.norm(jacobian, axis=(1, 2))
        singular = np.abs(np.linalg.det(jacobian)) < 1e-9 * size**3
        jacobian[singular] += 1e-2 * size[singular, None, None] * np.eye(3)
        step = np.linalg.solve(jacobian, misfit[moving][..., None])[..., 0]
        step *= np.minimum(1.0, 0.7 / np.maximum(np.abs(step).max(axis=1), 1e-300))[:, None]
        fraction, waiting = np.ones(len(moving)), np.arange(len(moving))
        for _ in range(_HALVINGS):
            pairs = moving[waiting]
            there = np.clip(local[pairs] + fraction[waiting, None] * step[waiting], -1.0 - _FARTHEST, 1.0 + _FARTHEST)
            remaining = points[pairs] - _image(kind, corners[pairs], there)
            length = np.linalg.norm(remaining, axis=1)
            nearer = length < distance[pairs]
            taken = pairs[nearer]
            local[taken], misfit[taken], distance[taken] = there[nearer], remaining[nearer], length[nearer]
            waiting = waiting[~nearer]
            fraction[waiting] /= 2.0
            if not len(waiting):
                break
        # A pair whose distance no step shortens stays where it is; one far outside belongs to another element.
        stopped = np.zeros(len(moving), dtype=bool)
        stopped[waiting] = True
        moving = moving[~stopped & (distance_outside(kind, local[moving]) < _FARTHEST)]
    return local, distance


def _image(kind: str, corners: np.ndarray, local: np.ndarray) -> np.ndarray:
    """(p, 3) the points at the local coordinates (p, 3)."""
    return (shape_values(kind, local)[:, None, :] @ corners)[:, 0]


def _jacobian(kind: str, corners: np.ndarray, local: np.ndarray) -> np.ndarray:
    """(p, 3, 3) dX/dxi at the local coordinates (p, 3)."""
    return corners.transpose(0, 2, 1) @ shape_gradients(kind, local)
