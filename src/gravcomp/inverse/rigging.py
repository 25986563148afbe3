"""The cables as the motors hold them: which displacements are possible, and how loose a cable may be.

Motors that are shared couple the displacements of their cables, and keep them taut by their preload.
"""

import numpy as np

from gravcomp.description import Robot
from gravcomp.description.transmission import Transmission
from gravcomp.inverse.limits import within_limits
from gravcomp.inverse.scaling import NO_BOUND, UNCOUPLED, Couplings


class Rigging:
    """Cables and motors of one robot.

    Attributes: couplings, of the paths by shared motors; coupled (m,): the cables that have such a motor; has_coupled: whether
    there are any; shared: whether the motors make other displacements than those that are asked of them.
    """

    def __init__(self, robot: Robot, transmission: Transmission | None):
        """transmission: of motors that are shared; None: one motor for each cable."""
        self._cables, self._limits = robot.cables, robot.limits
        self._transmission = None if transmission is None or transmission.direct else transmission
        self.shared = self._transmission is not None
        self.couplings = UNCOUPLED if self._transmission is None else _couplings(self._transmission)
        rows = self.couplings.rows
        self.coupled = rows.any(axis=0) if len(rows) else np.zeros(len(robot.cables), bool)
        self.has_coupled = bool(self.coupled.any())
        self._least: tuple[float, np.ndarray] | None = None  # a pretension, and the bounds that follow from it

    def possible(self, displacement: np.ndarray, tension: np.ndarray) -> np.ndarray:
        """Return displacements (m,) that the motors can make, nearest for the cables with the largest tensions (m,)."""
        return displacement if self._transmission is None else self._transmission.possible(displacement, tension)

    def paid_out(self, slack: np.ndarray, previous: np.ndarray, interval: float) -> np.ndarray:
        """Return displacements (m,) on the way from `previous` (m,) to those of slack cables (m,), in `interval` s."""
        return self.possible(within_limits(slack, previous, self._limits, interval), np.zeros(len(slack)))

    def least_tension(self, pretension: float) -> np.ndarray:
        """Return the lower bounds (m,) of the tensions in N; pretension: in N, of cables without their own.

        Cables that share a motor have none but that of the preload.
        """
        if self._least is None or self._least[0] != pretension:
            own = [pretension if cable.pretension is None else cable.pretension for cable in self._cables]
            self._least = pretension, np.where(self.coupled, 0.0, np.maximum(own, self._limits.tension_min))
        return self._least[1]


def _couplings(transmission: Transmission) -> Couplings:
    """Return what the motors' transmission demands of the paths."""
    rows, antagonists = transmission.couplings()
    least = rows @ transmission.preload
    return Couplings(rows, least, np.where(antagonists, NO_BOUND, least))
