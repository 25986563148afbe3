"""Triangles of a surface that pass through one another."""

import numpy as np

# Pairs of triangles side by side along the body; with more, the search is left to the mesher.
_PAIRS_MAX, _AT_ONCE = 30_000_000, 1_000_000


def intersecting_triangles(nodes: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the numbers (i,) of the triangles that an edge of another one pierces; neighbours do not count."""
    corners = nodes[faces]
    low, high = corners.min(axis=1), corners.max(axis=1)
    axis = int(np.argmax(np.ptp(nodes, axis=0)))
    order = np.argsort(low[:, axis], kind="stable")
    end = np.searchsorted(low[order, axis], high[order, axis], side="right")
    count = np.maximum(end - np.arange(len(order)) - 1, 0)
    if count.sum() > _PAIRS_MAX:
        return np.zeros(0, dtype=int)
    found: list[np.ndarray] = []
    total = np.cumsum(count)
    start = 0
    while start < len(order):
        stop = max(start + 1, int(np.searchsorted(total, (total[start - 1] if start else 0) + _AT_ONCE, side="right")))
        part = np.arange(start, stop)
        one = np.repeat(part, count[part])
        other = one + 1 + np.arange(len(one)) - np.repeat(np.cumsum(count[part]) - count[part], count[part])
        one, other = order[one], order[other]
        near = (low[one] <= high[other]).all(axis=1) & (low[other] <= high[one]).all(axis=1)
        one, other = one[near], other[near]
        apart = ~(faces[one][:, :, None] == faces[other][:, None, :]).any(axis=(1, 2))
        one, other = one[apart], other[apart]
        crossed = _pierces(corners[one], corners[other]) | _pierces(corners[other], corners[one])
        found += [one[crossed], other[crossed]]
        start = stop
    return np.unique(np.concatenate(found)) if found else np.zeros(0, dtype=int)


def _pierces(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Whether an edge of triangle one (p, 3, 3) passes through the inside of triangle other (p, 3, 3)."""
    origin, a, b = other[:, 0], other[:, 1] - other[:, 0], other[:, 2] - other[:, 0]
    normal = np.cross(a, b)
    squared = np.maximum((normal**2).sum(axis=1), 1e-300)
    height = np.einsum("pci,pi->pc", one - origin[:, None], normal)
    tolerance = 1e-9 * np.sqrt(squared) * np.sqrt(np.maximum((a**2).sum(axis=1), (b**2).sum(axis=1)))
    result = np.zeros(len(one), dtype=bool)
    for i, j in ((0, 1), (1, 2), (2, 0)):
        through = (height[:, i] * height[:, j] < 0.0) & (np.minimum(np.abs(height[:, i]), np.abs(height[:, j])) > tolerance)
        part = np.where(through, height[:, i] / np.where(through, height[:, i] - height[:, j], 1.0), 0.0)
        point = one[:, i] + part[:, None] * (one[:, j] - one[:, i]) - origin
        u = np.einsum("pi,pi->p", np.cross(point, b), normal) / squared
        v = np.einsum("pi,pi->p", np.cross(a, point), normal) / squared
        result |= through & (u > 1e-6) & (v > 1e-6) & (u + v < 1.0 - 1e-6)
    return result
