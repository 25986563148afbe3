"""Load cells at the capstans of the virtual robot, with noise and the usual mistakes."""

import numpy as np

from gravcomp.graph.parameters.virtual_load_cells import VirtualLoadCellParameters
from gravcomp.virtual.truth import Truth


class VirtualLoadCells:
    """Measures the tensions at the rate of `parameters`. The same seed gives the same measurements."""

    def __init__(self, parameters: VirtualLoadCellParameters, tension_max: float, seed: int):
        """tension_max in N: full scale of a cell."""
        self._parameters, self._full = parameters, tension_max
        self._random = np.random.default_rng([seed, 6])
        self._offset: np.ndarray | None = None
        self._due = 0.0

    def observe(self, truth: Truth) -> np.ndarray | None:
        """Return the tensions (m,) N if a measurement is due. Call it more often than the cells' rate."""
        p = self._parameters
        if p.rate <= 0.0 or truth.time < self._due - 1e-9:
            return None
        self._due = max(self._due + 1.0 / p.rate, truth.time)
        if self._offset is None:
            self._offset = p.offset * self._full * self._random.standard_normal(len(truth.tension))
        deviation = p.noise * truth.tension + p.floor * self._full
        measured: np.ndarray = truth.tension + self._offset + deviation * self._random.standard_normal(len(truth.tension))
        return measured
