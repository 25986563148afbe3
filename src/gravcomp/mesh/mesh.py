"""A finite-element mesh with its materials."""

import dataclasses

import numpy as np

from gravcomp.description import Material


class MeshError(ValueError):
    """A body that cannot be meshed, or an unusable mesh; the text says what was found and what is allowed."""


@dataclasses.dataclass(frozen=True)
class Mesh:
    """A body in `soft_base`, at rest, clamped at z = 0.

    kind: one of `elements.KINDS`, the nodes of an element ordered as in VTK; nodes (n, 3) in m; elements (k, c) indices;
    region (k,): index into `materials`; length: rest length in m; stations (s,): heights in m, from 0 to length, at which
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
        """Indices (b,) of the nodes on the base."""
        return np.flatnonzero(self.nodes[:, 2] < 1e-6 * self.length)

    @property
    def tip(self) -> np.ndarray:
        """Indices (t,) of the nodes on the end face."""
        return np.flatnonzero(self.nodes[:, 2] > (1.0 - 1e-6) * self.length)

    def renumbered(self, order: np.ndarray) -> "Mesh":
        """Return the same mesh with other node numbers: its node i is this mesh's node order[i]."""
        rank = np.empty(len(order), dtype=np.int64)
        rank[order] = np.arange(len(order))
        return dataclasses.replace(self, nodes=self.nodes[order], elements=rank[self.elements])
