"""Search for the static equilibrium of a robot from any state: tracking, then load steps from the straight robot.

Not every load has an equilibrium: St. Venant-Kirchhoff's material softens in strong compression (see
`materials.st_venant_kirchhoff`), so that a robot of it folds under a large tension.
"""

import dataclasses

import numpy as np

from gravcomp.full_model.cable_input import CableInput
from gravcomp.full_model.equilibrium import Equilibrium
from gravcomp.full_model.tracking import StaticTracker
from gravcomp.full_model.wrench import PointLoads, Wrench

# Parts of the load in which it is applied where an obstacle has friction.
_RUBBING_PART = 0.1


class StaticSolver(StaticTracker):
    """Finds equilibria of a model and tracks them."""

    def solve(
        self, gravity: np.ndarray, cables: CableInput, parts: int = 64, wrench: Wrench | tuple[Wrench, ...] | None = None
    ) -> Equilibrium:
        """Return the equilibrium under gravity (3,), the cables' input and point loads.

        If tracking from the current state fails, the load is applied in steps to the straight robot; a step that fails is
        halved. If a step of 1 / parts of the load fails, the branch of equilibria ends there in a limit point, or nearly: the
        last equilibrium is returned with `load_fraction` below 1 and `converged` False, and the solver keeps its state.
        """
        start, loads = self.state, PointLoads.of(self.model, wrench)
        depth, rubs = self._obstacles(gravity)
        if not depth and not rubs and self.track(gravity, cables, iterations=15, exact=True, loads=loads).converged:
            return self.state
        self.reset()
        here, origin = self.state, self.state.tendons.displacement
        # Friction depends on the way: the whole load at once is none.
        done, part = 0.0, _RUBBING_PART if rubs else 0.25
        while done < 1.0:
            fraction = min(1.0, done + part)
            force = fraction * np.asarray(gravity)
            if self.contact is not None:
                self.contact.allowed = (1.0 - fraction) * depth
            if self.track(force, cables.part(origin, fraction), 15, exact=True, loads=loads, fraction=fraction).converged:
                here, done, part = self.state, fraction, part if rubs else 2.0 * part
                continue
            self.state = here
            part /= 2.0
            if part < 1.0 / parts:
                self.state = start
                return dataclasses.replace(here, converged=False, load_fraction=done)
        return self.state

    def _obstacles(self, gravity: np.ndarray) -> tuple[float, bool]:
        """Return how deep in m the straight robot is in an obstacle under gravity (3,), and whether any obstacle has friction."""
        if self.contact is None:
            return 0.0, False
        self.contact.begin(np.zeros_like(self.state.u), gravity)
        return self.contact.depth(np.zeros_like(self.state.u)), self.contact.rubbing
