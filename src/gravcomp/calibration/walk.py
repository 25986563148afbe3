"""Shapes of the full model at rest in a sequence of windows, each with the creep that those before it left behind."""

import dataclasses
from dataclasses import dataclass

import numpy as np

from gravcomp.cables.friction import Sliding
from gravcomp.calibration.measured import StillWindows
from gravcomp.full_model.cable_input import CableInput
from gravcomp.full_model.creep import Creep
from gravcomp.full_model.equilibrium import Equilibrium
from gravcomp.full_model.linear_response import observed
from gravcomp.full_model.robot_model import RobotModel
from gravcomp.full_model.statics import StaticSolver
from gravcomp.mechanics.viscous_strain import ViscousStrain
from gravcomp.standard_gravity import STANDARD_GRAVITY

_BALANCED = 1e-5  # force out of balance over the robot's weight, at which it counts as at rest
_SHORTEST = 1e-3  # s, of a step of creep


@dataclass(frozen=True)
class Step:
    """One step: the robot is under gravity (3,) with the cables at displacement (m,), NaN: released, `duration` s after the last.

    duration None: relaxed, as after a long time. window: whose tip is predicted, None for a step in between. The others are the
    result: tip (6,), tension (m,), by_offset (6, m), and the state, how its cables slid, and what the branches held in it.
    """

    gravity: np.ndarray
    displacement: np.ndarray
    duration: float | None
    window: int | None
    tip: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros(6))
    tension: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros(0))
    by_offset: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros((6, 0)))
    state: Equilibrium | None = None
    sliding: Sliding | None = None
    viscous: ViscousStrain | None = None

    @property
    def key(self) -> bytes:
        """What a relaxed robot without friction has its shape from."""
        return self.gravity.tobytes() + self.displacement.tobytes()


def steps_of(windows: StillWindows, crept: bool) -> list[Step]:
    """Return the steps through the windows. crept: with times; else each window is relaxed."""
    history, steps = windows.history, []
    for k, (gravity, displacement) in enumerate(zip(windows.gravity, windows.displacement)):
        if history is None or not crept:
            steps.append(Step(gravity, displacement, None, k))
            continue
        if k == 0 or history.trial[k] != history.trial[k - 1]:
            start = history.starts[int(history.trial[k])]
            steps.append(Step(start.gravity, start.displacement, None, None))
            now = start.time
        if history.began[k] > now + _SHORTEST:
            steps.append(Step(gravity, displacement, float(history.began[k] - now), None))
            now = history.began[k]
        steps.append(Step(gravity, displacement, max(_SHORTEST, float(history.time[k] - now)), k))
        now = history.time[k]
    return steps


class Walk:
    """Computes steps with one model, whose parameters may change between walks."""

    def __init__(self, model: RobotModel, times: tuple[float, ...]):
        """times: of the branches in s."""
        self._model, self._solver = model, StaticSolver(model)
        self._creep, self._times = Creep(model), times
        self._weight = model.mass * STANDARD_GRAVITY

    def run(self, steps: list[Step], creep: np.ndarray, known: list[Step] | None = None) -> list[Step]:
        """Return the steps with their results. creep (b,): ratio of each branch; known: steps of nearly the same parameters.

        Raises RuntimeError if there is no equilibrium.
        """
        self._solver.reset()
        if self._times:
            self._creep.set_ratio(creep)
        done: list[Step] = []
        for number, step in enumerate(steps):
            near = known[number].state if known else None
            done.append(self._seen(step, *self._through(step, near)))
        return done

    def near(self, step: Step, known: Step) -> np.ndarray:
        """Return the tip (6,) of a step near `known`, with what the branches held in that one, and its cables' friction."""
        assert known.state is not None and known.sliding is not None  # it has been computed
        self._solver.state, self._solver.sliding = known.state, known.sliding
        state = self._solve(step, known.viscous, known.state)
        if not state.converged:
            raise RuntimeError(_lost(step))
        return self._seen(step, state, known.viscous).tip

    def _through(self, step: Step, near: Equilibrium | None) -> tuple[Equilibrium, ViscousStrain | None]:
        """Go from the last step to this one; return the state and what the branches held. Raises RuntimeError."""
        viscous = None
        if step.duration is not None and self._creep.exists:
            viscous = self._creep.step(step.duration)
        start = self._solver.state
        state = self._solve(step, viscous, near)
        if not state.converged and near is not None:
            self._solver.state = start
            state = self._solve(step, viscous, None)
        if not state.converged:
            # From the straight robot, first as if it had relaxed: what it holds is a small part of the stress.
            self._solver.viscous = None
            state = self._solver.solve(step.gravity, CableInput(wound=step.displacement))
            if state.converged and viscous is not None:
                state = self._solve(step, viscous, None)
        if not state.converged:
            raise RuntimeError(_lost(step))
        if viscous is not None and step.duration is not None:
            self._creep.advance(state.u, step.duration)
        elif self._creep.exists:
            self._creep.relax(state.u)
        return state, viscous

    def _solve(self, step: Step, viscous: ViscousStrain | None, near: Equilibrium | None) -> Equilibrium:
        solver, cables = self._solver, CableInput(wound=step.displacement)
        if near is not None:
            last = solver.state
            if self._model.tendons.friction.any():  # the cables slide from where they were, not from where `near` has them
                solver.sliding = cables.sliding(solver.sliding, last.tension, last.tendons.displacement)
            tendons = self._model.tendons.state(self._model.mesh.nodes + near.u, solver.sliding.direction)
            solver.state = dataclasses.replace(near, tendons=tendons)
        solver.viscous = viscous
        state = solver.track(step.gravity, cables, iterations=15)
        if state.residual < _BALANCED * self._weight:
            # Creep makes the last steps shrink slowly; forces so small move no tip.
            state.converged = True
        return state

    def _seen(self, step: Step, state: Equilibrium, viscous: ViscousStrain | None) -> Step:
        """Return the step with its result."""
        _, _, effector, _, response = observed(self._model, state)
        taut = state.tension > 0.0
        by_offset = np.zeros((6, len(taut)))
        if taut.any():
            own = response.compliance_aa[np.ix_(taut, taut)]
            by_offset[:, taut] = np.linalg.solve(own.T, response.compliance_ea[:6, taut].T).T
        return dataclasses.replace(
            step,
            tip=effector[:6].copy(),
            tension=state.tension,
            by_offset=by_offset,
            state=state,
            viscous=viscous,
            sliding=self._solver.sliding,
        )


def _lost(step: Step) -> str:
    """Return the sentence about a step that has no equilibrium."""
    return (
        f"no equilibrium at gravity {np.round(step.gravity, 2).tolist()} m/s^2 and displacements"
        f" {np.round(1e3 * step.displacement, 2).tolist()} mm"
    )
