"""Cross-sections of the body as linear functionals of its nodes.

For a height Z of the straight body, points of the section there are fitted by x(X, Y) = p + f_1 X + f_2 Y (least squares, every
point weighted by its share of the area). p is the present position of the axis, f_1 and f_2 are the present directions of the
section's x and y, and d = f_1 x f_2 / |f_1 x f_2| is the direction of the axis. p, f_1 and f_2 are weighted sums of node
positions.
"""

import numpy as np

from gravcomp.mesh.embedding import embed
from gravcomp.mesh.mesh import Mesh, MeshError

_RINGS, _SPOKES = 9, 18


def section_functionals(mesh: Mesh, heights: np.ndarray) -> np.ndarray:
    """Return (3 s, n) the rows p, f_1, f_2 of every height (s,) in m, to be multiplied with node positions (n, 3).

    Raises MeshError for a height at which the body has no section.
    """
    largest = np.hypot(mesh.nodes[:, 0], mesh.nodes[:, 1]).max()
    radius, angle = np.meshgrid(
        largest * (np.arange(_RINGS) + 0.5) / _RINGS, 2 * np.pi * np.arange(_SPOKES) / _SPOKES, indexing="ij"
    )
    disc = np.column_stack([(radius * np.cos(angle)).ravel(), (radius * np.sin(angle)).ravel()])
    rows = np.zeros((3 * len(heights), len(mesh.nodes)))
    # One search for all heights: it costs as much as one for each of three.
    found = embed(mesh, np.column_stack([np.tile(disc, (len(heights), 1)), np.repeat(heights, len(disc))]))
    for index, height in enumerate(heights):
        own = np.arange(index * len(disc), (index + 1) * len(disc))
        within = found.outside[own] < 1e-6
        if within.sum() < 6:
            raise MeshError(f"the body has no cross-section at z = {height * 1e3:g} mm for the backbone")
        area = radius.ravel()[within]
        design = np.column_stack([np.ones(within.sum()), disc[within]])
        fit = np.linalg.solve(design.T @ (area[:, None] * design), design.T * area)
        for row in range(3):
            np.add.at(rows[3 * index + row], found.nodes[own[within]], fit[row][:, None] * found.weights[own[within]])
    rows[np.abs(rows) < 1e-9 * np.abs(rows).max(axis=1, keepdims=True)] = 0.0
    return rows
