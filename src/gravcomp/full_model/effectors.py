"""Observed cross-sections of a mesh and their derivatives. `observation.observe` computes tip and backbone from them."""

import numpy as np

from gravcomp.mesh.mesh import Mesh
from gravcomp.mesh.sections import section_functionals


class Effectors:
    """Sections at tip and backbone of a mesh whose free nodes come first. station (n,): 0 at the base to 1 at the tip."""

    def __init__(self, mesh: Mesh, station: np.ndarray):
        from scipy.sparse import csr_matrix

        self.station = station
        self.n_free = len(mesh.nodes) - len(mesh.clamped)
        rows = section_functionals(mesh, np.append(station, 1.0) * mesh.length)
        self.tip_weights = rows[-3]
        self._rows = csr_matrix(rows)
        self._free_rows = csr_matrix(rows[:, : self.n_free])

    def sections(self, x: np.ndarray) -> np.ndarray:
        """Return (n + 1, 3, 3) p, f_1, f_2 of every backbone point and, last, of the tip, at node positions x (n, 3)."""
        return (self._rows @ x).reshape(-1, 3, 3)

    def section_changes(self, change: np.ndarray) -> np.ndarray:
        """Return (n + 1, 3, 3, k) changes of the sections for changes (3 n_free, k) of the unknowns."""
        columns = change.shape[1]
        moved = self._free_rows @ change.reshape(self.n_free, 3 * columns)
        return moved.reshape(len(self.station) + 1, 3, 3, columns)
