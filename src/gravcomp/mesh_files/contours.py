"""The closed contours of the section of a surface at a height: its outline and its lumens."""

import numpy as np

from gravcomp.mesh_files.errors import MeshError
from gravcomp.mesh_files.level_cut import level_cut
from gravcomp.mesh_files.welding import welded

# Contours that enclose less than this part of the largest one are rounding at a vertex of the surface.
_SMALLEST = 1e-6


def section_contours(triangles: np.ndarray, height: float) -> list[np.ndarray]:
    """Return the contours at `height` (m), each its corners (n, 2) in order, the largest first.

    triangles (t, 3, 3): a closed surface that faces outward. Outlines run counterclockwise, lumens clockwise. Raises MeshError
    where the section is no set of closed contours.
    """
    segments = level_cut(triangles, height)
    if not len(segments):
        return []
    nodes, edges, _ = welded(segments.reshape(-1, 2), np.arange(2 * len(segments)).reshape(-1, 2))
    edges = edges[edges[:, 0] != edges[:, 1]]
    following = np.full(len(nodes), -1)
    following[edges[:, 0]] = edges[:, 1]
    arrivals = np.bincount(edges[:, 1], minlength=len(nodes))
    starts = np.bincount(edges[:, 0], minlength=len(nodes))
    if (starts > 1).any() or (arrivals != starts).any():
        raise MeshError(f"the section at {1e3 * height:.4g} mm is not bounded by closed contours")
    contours = []
    waiting = set(np.flatnonzero(starts).tolist())
    while waiting:
        loop = [waiting.pop()]
        while (after := int(following[loop[-1]])) != loop[0]:
            loop.append(after)
            waiting.remove(after)
        contours.append(nodes[loop])
    contours.sort(key=lambda contour: -abs(enclosed_area(contour)))
    return [contour for contour in contours if abs(enclosed_area(contour)) > _SMALLEST * abs(enclosed_area(contours[0]))]


def enclosed_area(contour: np.ndarray) -> float:
    """Return the area that corners (n, 2) enclose, positive where they run counterclockwise."""
    x, y = contour.T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))
