"""A finite-element mesh with its materials."""

import dataclasses

import numpy as np

from gravcomp.description import Material


class MeshError(ValueError):
    """A body that cannot be meshed or a mesh that cannot be computed with; the text is for people."""


@dataclasses.dataclass(frozen=True)
class Mesh:
    """A body in `soft_base`, at rest, clamped at z = 0.

    kind: 'hex20', 'tet10' or 'tet4', nodes of an element ordered as in VTK; nodes (n, 3) in m; elements (k, c) indices;
    region (k,) index into `materials`; length: rest length in m; stations (s,): heights in m, from 0 to length, at which
    cables are guided.
    """

    kind: str
    nodes: np.ndarray
    elements: np.ndarray
    region: np.ndarray
    materials: tuple[Material, ...]
    length: float
    stations: np.ndarray

    @property
    def clamped(self) -> np.ndarray:
        """(b,) indices of the nodes on the base."""
        return np.flatnonzero(self.nodes[:, 2] < 1e-6 * self.length)

    @property
    def tip(self) -> np.ndarray:
        """(t,) indices of the nodes on the end face."""
        return np.flatnonzero(self.nodes[:, 2] > (1.0 - 1e-6) * self.length)

    def renumbered(self, order: np.ndarray) -> "Mesh":
        """The same mesh whose node i is this one's node order[i]."""
        rank = np.empty(len(order), dtype=np.int64)
        rank[order] = np.arange(len(order))
        return dataclasses.replace(self, nodes=self.nodes[order], elements=rank[self.elements])
