"""The section of a closed surface with a plane: its area and centroid."""

import numpy as np


def plane_section(
    nodes: np.ndarray, triangles: np.ndarray, origin: np.ndarray, normal: np.ndarray, reach: float = np.inf
) -> tuple[float, np.ndarray]:
    """Return area and centroid (3,) of the section with the plane through `origin` across `normal`.

    The triangles face outward. Those with a corner farther than `reach` from the origin are left out; with a bent body they
    belong to another part of it. Green's theorem: the section is bounded by one segment in every triangle that the plane cuts.
    """
    height = (nodes - origin) @ normal
    height[height == 0.0] = 1e-300
    sides = height[triangles] > 0.0
    cut = triangles[sides.any(axis=1) & ~sides.all(axis=1)]
    if np.isfinite(reach) and len(cut):
        cut = cut[(np.linalg.norm(nodes[cut] - origin, axis=2) <= reach).all(axis=1)]
    if not len(cut):
        return 0.0, origin.copy()
    # The corner that is alone on its side comes first.
    sides = height[cut] > 0.0
    alone = np.where(sides.sum(axis=1) == 1, np.argmax(sides, axis=1), np.argmin(sides, axis=1))
    rolled = cut[np.arange(len(cut))[:, None], (alone[:, None] + np.arange(3)) % 3]
    a, b, c = (nodes[rolled[:, i]] - origin for i in range(3))
    ha, hb, hc = (height[rolled[:, i]][:, None] for i in range(3))
    p, q = a + ha / (ha - hb) * (b - a), a + ha / (ha - hc) * (c - a)
    along = np.cross(normal, np.cross(b - a, c - a))
    backward = np.einsum("ki,ki->k", q - p, along) < 0.0
    p[backward], q[backward] = q[backward].copy(), p[backward].copy()
    areas = 0.5 * np.cross(p, q) @ normal
    area = float(areas.sum())
    if area <= 0.0:
        return 0.0, origin.copy()
    return area, origin + (areas[:, None] * (p + q)).sum(axis=0) / (3.0 * area)
