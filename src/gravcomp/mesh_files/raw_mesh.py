"""A mesh as a file describes it."""

import dataclasses

import numpy as np


@dataclasses.dataclass(frozen=True)
class RawMesh:
    """A surface (kind tri3) or a volume (tet4, tet10, hex20): nodes (n, 3) in the file's unit, cells (k, c) indices as in VTK.

    unit: length of the file's unit in m where the format fixes it, else None; notes: sentences on what was changed.
    """

    kind: str
    nodes: np.ndarray
    cells: np.ndarray
    unit: float | None = None
    notes: tuple[str, ...] = ()

    @property
    def is_surface(self) -> bool:
        """Whether it consists of triangles."""
        return self.kind == "tri3"

    def with_notes(self, *notes: str) -> "RawMesh":
        """Return it with further notes."""
        return dataclasses.replace(self, notes=(*self.notes, *notes))
