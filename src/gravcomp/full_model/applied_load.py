"""The load that a track of `tracking` applies: the weight of a model, and loads at points."""

import numpy as np

from gravcomp.full_model.spring import Spring
from gravcomp.full_model.turning_loads import TurningFactor, add_symmetric_part, slopes_of
from gravcomp.full_model.wrench import PointLoads
from gravcomp.mechanics.block_matrix import BlockMatrix, Factor


class AppliedLoad:
    """The weight of a model and, in addition, loads that may turn with their sections, or come from springs."""

    def __init__(self, weight: np.ndarray, loads: PointLoads | None, fraction: float):
        """weight (3 n_free,) in N; loads: act by `fraction` of their value."""
        self._loads, self._fraction = loads, fraction
        self._weight = weight

    def at(self, u: np.ndarray) -> np.ndarray:
        """Return the forces (3 n_free,) at the displacements u (n, 3)."""
        return self._weight if self._loads is None else self._weight + self._loads.at(u, self._fraction)

    @property
    def turns(self) -> bool:
        """Whether a part of the load turns with its section."""
        return self._loads is not None and any(not isinstance(one, Spring) for one, _ in self._loads.turning)

    @property
    def springs(self) -> tuple[tuple[float, ...], ...]:
        """Fraction of the load, station and stiffness of each spring."""
        if self._loads is None:
            return ()
        springs = (one for one, _ in self._loads.turning if isinstance(one, Spring))
        return tuple((self._fraction, one.station, *one.stiffness) for one in springs)

    def add_to_tangent(self, matrix: BlockMatrix, u: np.ndarray) -> list[np.ndarray]:
        """Add to the stiffness what is symmetric of the loads that turn, at u (n, 3), and return it."""
        if self._loads is None or not self._loads.turning:
            return []
        return add_symmetric_part(matrix, self._loads, slopes_of(self._loads, u, self._fraction))

    def turned(self, factor: Factor, u: np.ndarray, contained: list[np.ndarray]) -> Factor:
        """Return the factor with the rest of what loads that turn add to the tangent at u (n, 3); contained: in the factor."""
        if self._loads is None or not self._loads.turning:
            return factor
        slopes = slopes_of(self._loads, u, self._fraction)
        if len(contained) == len(slopes) and all(np.array_equal(h, j) for h, j in zip(contained, slopes)):
            return factor
        return TurningFactor(factor, self._loads, slopes, contained)
