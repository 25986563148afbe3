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
        if self.track(gravity, cables, iterations=15, exact=True, loads=loads).converged:
            return self.state
        self.reset()
        origin = self.state.tendons.displacement
        return self._in_parts(np.zeros(3), np.asarray(gravity), origin, cables, 0.25, 1.0 / parts, start, loads, 15, True)

    def approach(self, before: np.ndarray, gravity: np.ndarray, cables: CableInput, parts: int = 16) -> Equilibrium:
        """Return the equilibrium that continues the current state, which balances the gravity `before` (3,), to a new load.

        The load changes in steps, which are halved where they fail, as in `solve`. This follows a large change in less time than
        a search from the straight robot, and stays on the branch of equilibria.
        """
        here = self.state
        origin = here.tendons.displacement + self.model.tendons.stretch(here.tendons) * here.tension
        return self._in_parts(np.asarray(before), np.asarray(gravity), origin, cables, 0.5, 1.0 / parts, here, None, 6, False)

    def _in_parts(
        self,
        before: np.ndarray,
        gravity: np.ndarray,
        origin: np.ndarray,
        cables: CableInput,
        part: float,
        least: float,
        kept: Equilibrium,
        loads: PointLoads | None,
        iterations: int,
        exact: bool,
    ) -> Equilibrium:
        """Change the load from `before` (3,) and the cables' displacements `origin` (m,) in steps, beginning with `part` of it.

        A step that fails is halved, down to `least`; iterations and exact: of `track`. Then the last equilibrium is returned,
        not converged, with the fraction of the load that it balances, and the solver keeps the state `kept`.
        """
        here, done = self.state, 0.0
        while done < 1.0:
            fraction = min(1.0, done + part)
            force = before + fraction * (gravity - before)
            state = self.track(force, cables.part(origin, fraction), iterations, exact=exact, loads=loads, fraction=fraction)
            if state.converged:
                here, done, part = self.state, fraction, 2.0 * part
                continue
            self.state = here
            part /= 2.0
            if part < least:
                self.state = kept
                return dataclasses.replace(here, converged=False, load_fraction=done)
        return self.state
