"""The path of the equilibria that keep the tip on a target, while gravity grows from zero.

At each share of gravity the tensions solve the inverse problem of `gravcomp.inverse` at the model's equilibrium, without rates:
programme and Newton's method in turn, until nothing changes. The next share starts from the tensions that the last two predict.
A step that does not lead to an equilibrium with a positive definite tangent is halved; the path ends where that does not help.
Of a robot that would sag by many lengths the steps are a share of those of others (`StaticSolver.share_of_steps`): its tensions
have to follow gravity closely.
"""

import dataclasses

import numpy as np

from gravcomp.description import Limits
from gravcomp.full_model.cable_input import CableInput
from gravcomp.full_model.equilibrium import Equilibrium
from gravcomp.full_model.linear_response import observed
from gravcomp.full_model.robot_model import RobotModel
from gravcomp.full_model.statics import StaticSolver
from gravcomp.full_model.tracking import StaticTracker
from gravcomp.holdability.options import HoldOptions
from gravcomp.holdability.tangent import Eigenvalues, Tangent
from gravcomp.inverse.damping import StepDamping
from gravcomp.inverse.errors import tip_errors
from gravcomp.inverse.options import InverseOptions
from gravcomp.inverse.programme import build_programme
from gravcomp.inverse.scaling import unscaled
from gravcomp.inverse.solver import ProgrammeSolver, SolverFailed
from gravcomp.inverse.target import Target
from gravcomp.standard_gravity import STANDARD_GRAVITY

# The question is whether the tip can be held laterally, at the cost of any shortening. The proximal term only makes steps settle;
# with less of it, tensions of equal effect are found sooner.
_INVERSE = InverseOptions(axial_weight=1e-3, proximal_weight=3e-4)
_NEWTON = 10
_PROGRAMMES = 20
# Changes of the cables below which a point has settled: of the robot's length, and of the largest tension.
_SETTLED, _SETTLED_TENSION = 2e-5, 5e-3
_UNDAMPED = 4.0
# Steps of a path, with those that fail, after which its search ends: a few seconds.
_MOST_STEPS = 60
# Steps toward the programme's tensions are halved at most this many times.
_HALVINGS = 3


@dataclasses.dataclass(frozen=True)
class PathPoint:
    """An equilibrium on a path.

    share of gravity; lateral and axial error of the tip in m; tension (m,) in N; displacement (m,) in m; eigenvalues of the
    tangent.
    """

    share: float
    lateral: float
    axial: float
    tension: np.ndarray
    displacement: np.ndarray
    eigenvalues: Eigenvalues


class HoldPath:
    """Follows the equilibria of a model that keep its tip on a target. The same calls give the same result.

    Attributes: model; target; options; linear_answer of the robot at rest (see `Tangent.answer`); least_step: over gravity.
    """

    def __init__(self, model: RobotModel, target: Target, options: HoldOptions):
        self.model, self.target, self.options = model, target, options
        self._tracker = StaticTracker(model)
        self._tangent = Tangent(model)
        self._solver = ProgrammeSolver()
        self.linear_answer = self._tangent.answer
        solver = StaticSolver(model)
        self._share = min(solver.share_of_steps(STANDARD_GRAVITY * across) for across in np.eye(3)[:2])
        self.least_step = self._share * options.least_step

    @property
    def displacements(self) -> np.ndarray:
        """Displacements (nodes, 3) in m at the last point of the last path."""
        return self._tracker.state.u

    @property
    def leaves(self) -> bool:
        """Whether paths may be left where the tip is no longer held: those of a soft robot take many steps."""
        return self._share < 1.0

    def has_left(self, point: PathPoint) -> bool:
        """Return whether a path that may be left is left at this point: the tip is no longer held."""
        return self.leaves and point.lateral > self.options.tolerance * self.model.length

    def follow(
        self, gravity: np.ndarray, limits: Limits, first: np.ndarray, most: float = 1.0, *, may_leave: bool = False
    ) -> list[PathPoint]:
        """Return the points of the path from no gravity to `most` times gravity (3,) in m/s^2, or to where it ends.

        limits: of tension and displacement, without rates (`limits.unlimited_rates`). first (m,): tensions in N that hold about
        the whole gravity, of a linear estimate. may_leave: the path also ends where it `has_left`. No point at all: no shape of
        the weightless robot is found.
        """
        self._tracker.reset()
        self._solver.reset()
        start = self._settled(np.zeros(3), np.zeros(len(first)), limits)
        if start is None:
            return []
        points = [self._point(0.0, start)]
        step = self._share * self.options.first_step
        for _ in range(_MOST_STEPS):
            if points[-1].share >= most or (may_leave and self.has_left(points[-1])):
                break
            share = min(most, points[-1].share + step)
            before, sliding = self._tracker.state, self._tracker.sliding
            guess = np.clip(_predicted(points, share, first), limits.tension_min, limits.tension_max)
            state = self._settled(share * gravity, guess, limits)
            point = None if state is None else self._point(share, state)
            if point is not None and point.eigenvalues.free > 0.0:
                points.append(point)
                step *= 2.0
                continue
            self._tracker.state, self._tracker.sliding = before, sliding
            step /= 2.0
            if step < self.least_step * max(1.0, points[-1].share):
                break
        return points

    def lateral(self, state: Equilibrium) -> float:
        """Return the lateral error of the tip in m at a state of the model."""
        effector = observed(self.model, state).effector
        return float(tip_errors(effector, self.target.tip_position, self.target.direction_or_zeros).lateral)

    def _settled(self, gravity: np.ndarray, tension: np.ndarray, limits: Limits) -> Equilibrium | None:
        """Return the equilibrium under gravity (3,) nearest to the target, from the tensions (m,) on; None if there is none."""
        model, damping = self.model, StepDamping(self.model.length)
        state = self._tracked(gravity, tension)
        last = np.zeros(len(tension))
        for _ in range(_PROGRAMMES):
            if state is None:
                return None
            seen = observed(model, state)
            response = seen.response
            programme = build_programme(
                response,
                self.target,
                limits,
                tension=state.tension,
                displacement=seen.displacement,
                backbone_station=model.effectors.station,
                interval=1.0,
                damping=damping.factor,
                options=_INVERSE,
            )
            try:
                solution = self._solver.solve(programme)
            except SolverFailed:
                return None
            wanted, _ = unscaled(
                solution.unknowns, solution.multipliers, programme.scale, programme.tension_lower, programme.tension_upper
            )
            change = response.compliance_aa @ (wanted - state.tension)
            largest = max(wanted.max(initial=0.0), state.tension.max(initial=0.0))
            if (
                damping.factor <= _UNDAMPED  # damped steps are short anywhere
                and np.abs(change).max() <= _SETTLED * model.length
                and np.abs(wanted - state.tension).max() <= _SETTLED_TENSION * largest
            ):
                return state
            damping.observe(float(change @ last), float(np.linalg.norm(change) * np.linalg.norm(last)))
            last = change
            state = self._moved(gravity, state, wanted)
        # Where the equilibria end, the steps become shorter and shorter and do not settle.
        return state if state is not None and self.lateral(state) <= self.options.tolerance * model.length else None

    def _moved(self, gravity: np.ndarray, state: Equilibrium, wanted: np.ndarray) -> Equilibrium | None:
        """Return the equilibrium at the tensions `wanted` (m,), or part of the way to them; None if there is none."""
        sliding = self._tracker.sliding
        for halving in range(_HALVINGS + 1):
            moved = self._tracked(gravity, state.tension + (wanted - state.tension) / 2.0**halving)
            if moved is not None:
                return moved
            self._tracker.state, self._tracker.sliding = state, sliding
        return None

    def _tracked(self, gravity: np.ndarray, tension: np.ndarray) -> Equilibrium | None:
        state = self._tracker.track(gravity, CableInput(tension=tension), iterations=_NEWTON)
        return state if state.converged else None

    def _point(self, share: float, state: Equilibrium) -> PathPoint:
        seen = observed(self.model, state)
        errors = tip_errors(seen.effector, self.target.tip_position, self.target.direction_or_zeros)
        eigenvalues = self._tangent.smallest(state)
        return PathPoint(share, float(errors.lateral), float(errors.axial), state.tension, seen.displacement, eigenvalues)


def _predicted(points: list[PathPoint], share: float, first: np.ndarray) -> np.ndarray:
    """Return the tensions (m,) at a share of gravity, from the last two points or the linear estimate `first` (m,)."""
    last = points[-1]
    if len(points) == 1:
        return last.tension + (share - last.share) * first
    before = points[-2]
    return last.tension + (share - last.share) / (last.share - before.share) * (last.tension - before.tension)
