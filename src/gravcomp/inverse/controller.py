"""The inverse controller: one step from the model's linear answer and the target to what the winches shall do.

Each step is one Gauss-Newton iteration of the inverse problem around the state that the model has reached under the
last command: build the programme, solve it, turn its tensions into displacements, hold those to the limits and judge
the result. The model takes the displacements with the next sample of gravity, so the iteration runs in the closed loop
itself. Where it does not lead on, see `retreat`.
"""

import time
from typing import TYPE_CHECKING

import numpy as np
from numba import njit

from gravcomp.description import Robot
from gravcomp.inverse.command import Command, cable_displacement
from gravcomp.inverse.damping import StepDamping
from gravcomp.inverse.errors import backbone_missed, tip_errors
from gravcomp.inverse.limits import held_within, limits_met, within_limits
from gravcomp.inverse.options import InverseOptions
from gravcomp.inverse.programme import build_programme
from gravcomp.inverse.retreat import Move, Retreat
from gravcomp.inverse.scaling import unscaled
from gravcomp.inverse.solver import ProgrammeSolver, SolverFailed
from gravcomp.inverse.status import ControllerCode, judge
from gravcomp.inverse.target import Target

if TYPE_CHECKING:
    from gravcomp.full_model.shape import Response

# Longer pauses between two steps allow no longer strides: the linear answer would not carry that far.
_LONGEST_INTERVAL = 0.1


class InverseController:
    """Turns linear answers of the model into commands; remembers the last command and the last solution.

    robot: names and limits of the cables; options: see `InverseOptions`, replaceable at any time through `options`.
    """

    def __init__(self, robot: Robot, options: InverseOptions = InverseOptions()):
        self.robot = robot
        self.options = options
        self._names = robot.cable_names
        self._solver = ProgrammeSolver()
        self._retreat = Retreat(robot.length)
        self.reset()

    def reset(self, displacement: np.ndarray | None = None) -> None:
        """Forget the past: rates count from `displacement` (m,), or, without it, from where the cables' paths are at
        the next step.
        """
        self._solver.reset()
        self._damping = StepDamping()
        self._retreat.reset()
        self._displacement = None if displacement is None else np.array(displacement, dtype=float)
        self._tension = self._change = np.zeros(len(self.robot.cables))

    def step(
        self,
        response: "Response",
        target: Target,
        *,
        backbone_station: np.ndarray,
        tension: np.ndarray | None = None,
        interval: float = 0.01,
        followed: bool = True,
    ) -> Command:
        """The command that brings the modelled robot nearest to the target.

        backbone_station (n,): stations of the response's backbone rows; tension (m,) N: present tensions of the model
        (None: those of the last command); interval (s): since the last step; followed: whether the model's shape is its equilibrium under
        the last command, False where it found none and stayed. Never raises for a hard problem: see the
        command's code.
        """
        started = time.perf_counter()
        limits, options = self.robot.limits, self.options
        tension = self._tension if tension is None else np.asarray(tension, dtype=float)
        previous = self._displacement
        if previous is None:
            previous = response.compliance_aa @ tension + response.displacement_free
        interval = min(max(interval, 0.0), _LONGEST_INTERVAL)
        move = self._retreat.move(followed, target, _tip(response, tension), tension)
        if followed:
            interval *= self._retreat.stride
        if move != Move.ONWARD:
            return self._retreated(move, followed, response, target, previous, tension, interval, started)
        try:
            programme = build_programme(
                response,
                target,
                limits,
                tension=tension,
                displacement=previous,
                backbone_station=backbone_station,
                interval=interval,
                damping=self._damping.factor,
                options=options,
            )
            solution = self._solver.solve(programme)
        except SolverFailed as error:
            self._retreat.observe(np.zeros(len(previous)), interval)  # nothing moves
            return Command(
                displacement=previous,
                tension=tension,
                code=ControllerCode.SOLVER_FAILED,
                message=f"{error}; the last command is kept",
                solve_time=time.perf_counter() - started,
            )
        tension, self._change, along, lengths, displacement, effector, met, any_met, errors = _outcome(
            np.ascontiguousarray(response.compliance_aa),
            response.displacement_free,
            np.ascontiguousarray(response.compliance_ea),
            response.effector_free,
            tension,
            (solution.unknowns, solution.multipliers, programme.scale, programme.tension_lower, programme.tension_upper),
            options.slack,
            previous,
            self._change,
            (limits.displacement_rate * interval, limits.displacement_min, limits.displacement_max),
            limits.tension_max,
            target.tip_position,
            target.direction_or_zeros,
        )
        self._damping.observe(along, lengths)
        self._retreat.observe(displacement - previous, interval)
        if self._retreat.stride < 1.0:
            met[0] = False  # it is not the motors that hold it back
        missed = max(errors.distance * (target.tip_position_weight > 0.0), backbone_missed(effector, target, backbone_station))
        code, message = judge(
            target=target,
            points_missed=missed,
            tilt=errors.tilt,
            met=met if any_met else None,
            names=self._names,
            options=options,
        )
        self._displacement, self._tension = displacement, tension
        return Command(
            displacement=displacement,
            tension=tension,
            code=code,
            message=message,
            distance=errors.distance,
            lateral=errors.lateral,
            axial=errors.axial,
            tilt=errors.tilt,
            solve_time=time.perf_counter() - started,
        )

    def _paid_out(self, free: np.ndarray, previous: np.ndarray, interval: float) -> np.ndarray:
        """Displacements (m,) on the way from `previous` (m,) to those (m,) of cables that carry nothing."""
        return within_limits(free - self.options.slack, previous, self.robot.limits, interval)

    def _retreated(
        self,
        move: Move,
        followed: bool,
        response: "Response",
        target: Target,
        previous: np.ndarray,
        tension: np.ndarray,
        interval: float,
        started: float,
    ) -> Command:
        """The command of a move that does not lead to the target."""
        if move == Move.BACK:
            # To the shape that stands, whichever command it was of: the model may be a sample behind.
            path = response.compliance_aa @ tension + response.displacement_free
            shape = np.where(tension > 0.0, path, path - self.options.slack)
            displacement = within_limits(shape, previous, self.robot.limits, interval)
            code, message = (
                ControllerCode.UNREACHABLE,
                "the model finds no equilibrium on the way to the target: the last shape is kept",
            )
        else:
            # Where the equilibria end, the linear answer tells little of where the cables would be free; on the straight robot they are at 0.
            free = response.displacement_free if followed else np.minimum(response.displacement_free, 0.0)
            displacement = self._paid_out(free, previous, interval)
            code = ControllerCode.RELAXING
            if followed:
                message = "no way leads on to the target: paying the cables out, to try it from a shape nearer to rest"
            else:
                message = "the model finds no equilibrium: paying the cables out"
        self._displacement, self._tension = displacement, tension
        self._damping = StepDamping()  # of steps from elsewhere
        effector = response.compliance_ea @ tension + response.effector_free
        return Command(
            displacement,
            tension,
            code,
            message,
            time.perf_counter() - started,
            *tip_errors(effector, target.tip_position, target.direction_or_zeros),
        )

    def relax(self, response: "Response", *, interval: float = 0.01) -> Command:
        """Pay the cables out, at the rates allowed, until none of them carries any tension."""
        started = time.perf_counter()
        free = response.displacement_free
        previous = free - self.options.slack if self._displacement is None else self._displacement
        interval = min(max(interval, 0.0), _LONGEST_INTERVAL)
        displacement = self._paid_out(free, previous, interval)
        self.reset(displacement)
        relaxed = bool(np.all(displacement <= free - self.options.slack + 1e-6))
        return Command(
            displacement=displacement,
            tension=np.zeros(free.size),
            code=ControllerCode.RELAXING,
            message="the cables are paid out" if relaxed else "paying the cables out",
            solve_time=time.perf_counter() - started,
        )


def _tip(response: "Response", tension: np.ndarray) -> np.ndarray:
    """(3,) position of the tip under the tensions (m,)."""
    return response.compliance_ea[:3] @ tension + response.effector_free[:3]


@njit(cache=True)
def _outcome(
    compliance_aa, displacement_free, compliance_ea, effector_free, before, solution, slack, previous, last_change, travel, highest, tip,
    direction,
):  # fmt: skip
    """What the solution (arguments of `unscaled`) comes to, from the tensions `before` (m,): tension (m,), change of path displacement
    (m,), its product with the last one and that of their lengths, displacement (m,) of the winches, effector (e,), the limits met and
    whether any is, errors of the tip. travel: longest way of a step, least and largest displacement.
    """
    tension, unwanted = unscaled(*solution)
    path = compliance_aa @ tension + displacement_free
    change = compliance_aa @ (tension - before)
    along, lengths = (change * last_change).sum(), np.sqrt((change * change).sum() * (last_change * last_change).sum())
    displacement = held_within(cable_displacement(path, compliance_aa, unwanted, slack), previous, *travel)
    effector = compliance_ea @ tension + effector_free
    met, any_met = limits_met(displacement, previous, *travel, tension, highest)
    return tension, change, along, lengths, displacement, effector, met, any_met, tip_errors(effector, tip, direction)
