"""A finite-element mesh with its materials."""

import dataclasses

import numpy as np

from gravcomp.description import Material
from gravcomp.mesh_files import MeshError
from gravcomp.rest_axis import STRAIGHT, RestAxis

__all__ = ["Mesh", "MeshError"]


@dataclasses.dataclass(frozen=True)
class Mesh:
    """A body in `soft_base`, at rest, clamped at z = 0.

    kind: one of `elements.KINDS`, the nodes of an element ordered as in VTK; nodes (n, 3) in m; elements (k, c) indices;
    region (k,): index into `materials`; length: rest length in m along the axis; stations (s,): heights in m, from 0 to length,
    at which cables are guided; axis: the axis at rest; straight_nodes (n, 3): see `straight`, None for a straight axis;
    in_layers: all nodes lie at the stations, two of them to a layer of elements and one more.
    """

    kind: str
    nodes: np.ndarray
    elements: np.ndarray
    region: np.ndarray
    materials: tuple[Material, ...]
    length: float
    stations: np.ndarray
    axis: RestAxis = STRAIGHT
    straight_nodes: np.ndarray | None = None
    in_layers: bool = False

    @property
    def straight(self) -> np.ndarray:
        """Coordinates (n, 3) of the nodes on the straightened robot: place in the section, and arc length; see `rest_axis`."""
        return self.nodes if self.straight_nodes is None else self.straight_nodes

    @property
    def clamped(self) -> np.ndarray:
        """Indices (b,) of the nodes on the base."""
        return np.flatnonzero(self.straight[:, 2] < 1e-6 * self.length)

    @property
    def tip(self) -> np.ndarray:
        """Indices (t,) of the nodes on the end face."""
        return np.flatnonzero(self.straight[:, 2] > (1.0 - 1e-6) * self.length)

    def renumbered(self, order: np.ndarray) -> "Mesh":
        """Return the same mesh with other node numbers: its node i is this mesh's node order[i]."""
        rank = np.empty(len(order), dtype=np.int64)
        rank[order] = np.arange(len(order))
        straight = None if self.straight_nodes is None else self.straight_nodes[order]
        return dataclasses.replace(self, nodes=self.nodes[order], elements=rank[self.elements], straight_nodes=straight)
