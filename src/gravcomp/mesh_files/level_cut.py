"""The boundary of the section of a closed surface at a height."""

import numpy as np


def level_cut(triangles: np.ndarray, height: float) -> np.ndarray:
    """Return the segments (k, 2, 2) in which the plane z = height cuts triangles (t, 3, 3), with the body on their left.

    The triangles are counter-clockwise from outside. A corner in the plane counts as below it.
    """
    above = triangles[:, :, 2] > height
    crossing = above.any(axis=1) & ~above.all(axis=1)
    triangles, above = triangles[crossing], above[crossing]
    # The corner that is alone on its side comes first; the order of the corners, and so the outside, is kept.
    lone = np.where(above.sum(axis=1) == 1, above.argmax(axis=1), (~above).argmax(axis=1))
    a, b, c = (triangles[np.arange(len(triangles)), (lone + k) % 3] for k in range(3))
    part = ((height - a[:, 2]) / (b[:, 2] - a[:, 2]))[:, None], ((height - a[:, 2]) / (c[:, 2] - a[:, 2]))[:, None]
    one, other = a[:, :2] + part[0] * (b - a)[:, :2], a[:, :2] + part[1] * (c - a)[:, :2]
    upper = above[np.arange(len(above)), lone]
    return np.stack([np.where(upper[:, None], one, other), np.where(upper[:, None], other, one)], axis=1)
