"""Solid elements from the cells of a section, swept through layers."""

import dataclasses
import itertools
from collections.abc import Sequence

import numpy as np

from gravcomp.mesh.elements import is_hexahedron, reference_nodes
from gravcomp.mesh.quadratic import TET_EDGES


@dataclasses.dataclass(frozen=True)
class LayeredCells:
    """Elements between levels: two to a layer, and one more.

    elements (k, c): numbers of their nodes; layer (k,): which each lies in; planar, level (n,): of every node its number in the
    section and its level.
    """

    elements: np.ndarray
    layer: np.ndarray
    planar: np.ndarray
    level: np.ndarray


def layered_cells(kind: str, cells: np.ndarray, present: Sequence[np.ndarray]) -> LayeredCells:
    """Return the elements of a kind of `elements.KINDS`: hexahedra, or six tetrahedra for each (Kuhn's division).

    cells (m, 3, 3): numbers of the nodes of each cell in the section; present: of every layer which cells it has (m,).
    """
    numbers, layer_of = [], []
    # Nodes of an element in (radial, around, along) half steps of its cell.
    patterns = [np.rint(reference_nodes(kind) + 1).astype(int)] if is_hexahedron(kind) else _kuhn(quadratic=kind == "tet10")
    levels_high = 2 * len(present) + 1
    for pattern in patterns:
        for layer, here in enumerate(present):
            planar = cells[here][:, pattern[:, 0], pattern[:, 1]]
            numbers.append(planar * levels_high + 2 * layer + pattern[:, 2])
            layer_of.append(np.full(len(planar), layer))
    used, elements = np.unique(np.concatenate(numbers), return_inverse=True)
    return LayeredCells(elements.reshape(-1, len(patterns[0])), np.concatenate(layer_of), used // levels_high, used % levels_high)


def halved(values: np.ndarray) -> np.ndarray:
    """Return the values (v,) and the means between them (2 v - 1,)."""
    return np.interp(np.arange(2 * len(values) - 1) / 2.0, np.arange(len(values)), values)


def _kuhn(quadratic: bool) -> list[np.ndarray]:
    """The six tetrahedra of a cell: one for each order of walking its edges from the first corner to the opposite one."""
    tets = []
    for order in itertools.permutations(range(3)):
        corners = [np.zeros(3, dtype=int)]
        for axis in order:
            corners.append(corners[-1] + 2 * np.eye(3, dtype=int)[axis])
        if np.linalg.det(np.array(corners[1:]) - corners[0]) < 0:
            corners[1], corners[2] = corners[2], corners[1]
        mids = [(corners[a] + corners[b]) // 2 for a, b in TET_EDGES] if quadratic else []
        tets.append(np.array(corners + mids))
    return tets
