"""Forces of wrenches in reduced coordinates: a section's p, f_1 and f_2 are linear in q, s(q) = s(0) + S q."""

import numpy as np

from gravcomp.full_model.model import MeshedModel
from gravcomp.full_model.wrench import PointLoads


class ReducedLoads:
    """Projects wrenches on a basis; keeps S of each section that has carried one."""

    def __init__(self, model: MeshedModel, basis: np.ndarray):
        """basis: (3 n_free, r)."""
        self._model = model
        self._fields = basis.reshape(model.n_free, 3, -1)
        self._sections: dict[float, tuple[np.ndarray, np.ndarray]] = {}

    def at(self, loads: PointLoads, q: np.ndarray) -> np.ndarray:
        """Return the forces (r,) of the loads at q (r,)."""
        force = np.zeros_like(q)
        for wrench in loads.wrenches:
            rest, change = self._section(wrench.station)
            force += np.einsum("vi,vir->r", wrench.pulls(*(rest + change @ q)), change)
        return force

    def _section(self, station: float) -> tuple[np.ndarray, np.ndarray]:
        """Return s(0) (3, 3) and S (3, 3, r) of the section at a station."""
        if station not in self._sections:
            rows = self._model.section_rows(station)
            change = np.tensordot(rows[:, : self._model.n_free], self._fields, axes=1)
            self._sections[station] = rows @ self._model.mesh.nodes, change
        return self._sections[station]
