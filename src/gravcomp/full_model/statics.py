"""Search for the static equilibrium of a robot from any state: tracking, then load steps from the straight robot.

Not every load has an equilibrium: St. Venant-Kirchhoff's material softens in strong compression (see
`materials.st_venant_kirchhoff`), so that a robot of it folds under a large tension.
"""

import dataclasses

import numpy as np

from gravcomp.full_model.applied_load import AppliedLoad
from gravcomp.full_model.cable_input import CableInput
from gravcomp.full_model.equilibrium import Equilibrium
from gravcomp.full_model.payload import with_payload
from gravcomp.full_model.tracking import StaticTracker
from gravcomp.full_model.wrench import Load, PointLoads
from gravcomp.mechanics.block_matrix import NotPositiveDefinite
from gravcomp.mesh.mesh import MeshError

# Part of the load that is applied first, of a change of load, and that in which either is applied where an obstacle has friction.
_PART, _HALF, _RUBBING_PART = 0.25, 0.5, 0.1
# Smallest part of a change of load that continues an equilibrium.
_LEAST_PART = 1.0 / 16
# Lengths of the robot by which it may sag linearly before its loads change in smaller steps.
_SAG = 3.0


class StaticSolver(StaticTracker):
    """Finds equilibria of a model and tracks them."""

    def solve(
        self, gravity: np.ndarray, cables: CableInput, parts: int = 64, wrench: Load | tuple[Load, ...] | None = None
    ) -> Equilibrium:
        """Return the equilibrium under gravity (3,), the cables' input and point loads.

        If tracking from the current state fails, the load is applied in steps to the straight robot; a step that fails is
        halved. If a step of 1 / parts of the load fails, or of the share of it that suits a soft robot (`share_of_steps`), the
        branch of equilibria ends there in a limit point, or nearly: the last equilibrium is returned with `load_fraction` below
        1 and `converged` False, and the solver keeps its state.

        Obstacles that the straight robot is in are lowered by its depth, and rise to their place. Friction counts from where the
        robot is out of them, from a tenth of the load on: rising walls are no motion of the robot. Where no equilibrium is found
        on that way, one without friction is sought: it is one with friction too, in which nothing rubs.
        """
        start, loads = self.state, PointLoads.of(self.model, wrench)
        depth = self._depth(gravity)
        if not depth and not self._rubs and self.track(gravity, cables, iterations=15, exact=True, loads=loads).converged:
            return self.state
        self.reset()
        ends, origin = (np.zeros(3), np.asarray(gravity)), self.state.tendons.displacement
        least = self.share_of_steps(gravity, loads) / parts

        def loaded(first: float, last: float, part: float, depth: float) -> Equilibrium:
            finest = (last - first) * least
            span = first, last
            return self._in_parts(ends, origin, cables, part, finest, start, loads, 15, exact=True, depth=depth, span=span)

        if self.contact is None or not self._rubs:
            return loaded(0.0, 1.0, _PART, depth)
        done = 0.0
        if depth:
            with self.contact.without_friction():
                done, state = _RUBBING_PART, loaded(0.0, _RUBBING_PART, _PART * _RUBBING_PART, depth)
        if not depth or state.converged:
            state = loaded(done, 1.0, _RUBBING_PART, 0.0)
        if state.converged:
            return state
        self.reset()
        with self.contact.without_friction():
            here = loaded(0.0, 1.0, _PART, depth)
        if not here.converged:
            return state
        if not self.track(gravity, cables, iterations=15, exact=True, loads=loads).converged:
            self.state = here
        return self.state

    def share_of_steps(self, gravity: np.ndarray, loads: PointLoads | None = None) -> float:
        """Return by how much smaller the steps of a load have to be than those of a robot that sags by three lengths at most.

        By its linear response at rest, a long soft robot sags by many lengths, and no small part of its load converges from
        there. The solver has to be at rest: the current state is that of `reset`.
        """
        load = AppliedLoad(self.model.weight(gravity), with_payload(self.model, gravity, loads), 1.0).at(self.state.u)
        try:
            tip = np.kron(self.model.section_rows(1.0)[0, : self.model.n_free, None], np.eye(3))
            sag = float(np.linalg.norm(self.compliance(np.column_stack([tip, load]), loads)[:3, 3]))
        except (NotPositiveDefinite, MeshError):  # unstable, or a body without a section at its end
            return 1.0
        return min(1.0, _SAG * self.model.length / sag) if sag > 0.0 else 1.0

    def approach(self, before: np.ndarray, gravity: np.ndarray, cables: CableInput) -> Equilibrium:
        """Return the equilibrium that continues the current state, which balances the gravity `before` (3,), to a new load.

        The load changes in steps, which are halved where they fail, as in `solve`. This follows a large change in less time than
        a search from the straight robot, and stays on the branch of equilibria. Where none is found with friction, the robot
        slides to one without: near by, and without a gain of energy.
        """
        here, sliding = self.state, self.sliding
        origin = here.tendons.displacement + self.model.tendons.stretch(here.tendons) * here.tension
        part, ends = _RUBBING_PART if self._rubs else _HALF, (np.asarray(before), np.asarray(gravity))
        state = self._in_parts(ends, origin, cables, part, _LEAST_PART, here, None, 6, exact=False)
        if state.converged or self.contact is None or not self._rubs:
            return state
        self.sliding = sliding
        with self.contact.without_friction():
            return self._in_parts(ends, origin, cables, _HALF, _LEAST_PART, here, None, 6, exact=False)

    def _in_parts(
        self,
        ends: tuple[np.ndarray, np.ndarray],
        origin: np.ndarray,
        cables: CableInput,
        part: float,
        least: float,
        kept: Equilibrium,
        loads: PointLoads | None,
        iterations: int,
        *,
        exact: bool,
        depth: float = 0.0,
        span: tuple[float, float] = (0.0, 1.0),
    ) -> Equilibrium:
        """Change gravity from one of its `ends` (3,) to the other, and the cables' displacements from `origin` (m,), in steps.

        part: the first step's share of the load; a step that fails is halved, down to `least`. Then the last equilibrium is
        returned, not converged, with the fraction of the load that it balances, and the solver keeps the state `kept`.
        iterations, exact: of `track`. depth: m by which the robot is in an obstacle at first. span: fractions of the load that
        the current state balances, and up to which it changes; the obstacles are at their place there.
        """
        (before, gravity), here, sliding, (done, whole) = ends, self.state, self.sliding, span
        while done < whole:
            fraction = min(whole, done + part)
            force = before + fraction * (gravity - before)
            if self.contact is not None:
                self.contact.allowed = (1.0 - fraction / whole) * depth
            state = self.track(force, cables.part(origin, fraction), iterations, exact=exact, loads=loads, fraction=fraction)
            if state.converged:
                here, sliding, done, part = self.state, self.sliding, fraction, part if self._rubs else 2.0 * part
                continue
            self.state, self.sliding = here, sliding
            part /= 2.0
            if part < least:
                self.state = kept
                if self.contact is not None:
                    self.contact.allowed = 0.0
                return dataclasses.replace(here, converged=False, load_fraction=done)
        return self.state

    @property
    def _rubs(self) -> bool:
        """Whether any obstacle has friction."""
        return self.contact is not None and self.contact.rubbing

    def _depth(self, gravity: np.ndarray) -> float:
        """Return how deep in m the straight robot is in an obstacle under gravity (3,)."""
        if self.contact is None:
            return 0.0
        self.contact.place(gravity)
        return self.contact.depth(np.zeros_like(self.state.u))
