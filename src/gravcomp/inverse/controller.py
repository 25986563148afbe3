"""The inverse controller: computes the command to the winches from the model's linear response and the target.

Each step is one Gauss-Newton iteration of the inverse problem around the state that the model has reached under the last
command: build the quadratic programme, solve it, turn its tensions into displacements, clamp these to the limits and evaluate
the result. The model takes the displacements with the next sample of gravity, so the iteration runs in the closed loop itself.
`retreat` recovers from states in which the iteration does not get closer to the target.
"""

import dataclasses
import time
from typing import TYPE_CHECKING

import numpy as np

from gravcomp.contact.contacts import ObstacleForces
from gravcomp.description import Robot
from gravcomp.description.transmission import Transmission
from gravcomp.inverse.command import Command
from gravcomp.inverse.damping import StepDamping
from gravcomp.inverse.errors import backbone_missed, tip_errors
from gravcomp.inverse.limits import tip_over_cable, within_limits
from gravcomp.inverse.options import InverseOptions
from gravcomp.inverse.outcome import outcome
from gravcomp.inverse.programme import build_programme
from gravcomp.inverse.release import Release, ReleaseErrors
from gravcomp.inverse.retreat import Move, Retreat
from gravcomp.inverse.rigging import Rigging
from gravcomp.inverse.solver import ProgrammeSolver, SolverFailed
from gravcomp.inverse.status import ControllerCode, evaluate
from gravcomp.inverse.surroundings import Surroundings, rows_of
from gravcomp.inverse.target import Target
from gravcomp.mesh.robot_axis import rest_tip
from gravcomp.scene.scene import Scene

if TYPE_CHECKING:
    from gravcomp.full_model.shape import Response

# Of the robot's length: farthest that the winches may move the tip in a step. The linear response is not valid farther, and the
# model would have to search for the next shape. It counts after a pause between two steps; otherwise the winches are slower.
_FARTHEST = 0.1
_MORE_ENERGY = 30.0  # times the energy's weight where what is around the robot keeps it from its target
_LONGEST_INTERVAL = 0.1  # s in which cables are paid out in one step after a pause


class InverseController:
    """Computes commands from linear responses of the model. Keeps the last command and the last solution.

    Attributes: robot, of which the names and limits of the cables are used; options, which may be replaced at any time.
    """

    def __init__(
        self,
        robot: Robot,
        options: InverseOptions | None = None,
        transmission: Transmission | None = None,
        scene: Scene | None = None,
        zones: Scene | None = None,
    ):
        """Start without earlier steps.

        options: default `InverseOptions()`; transmission: of motors that are shared, default: one motor for each cable; scene:
        what the robot touches, of which a bound on its force needs to know; zones: forbidden to the robot. Raises ConfigError
        for a scene around a robot that has no outlines along its axis.
        """
        self.robot = robot
        self._surroundings = Surroundings(robot, scene, zones)
        self.options = options or InverseOptions()
        self._rigging = Rigging(robot, transmission)
        self._names = robot.cable_names
        self._solver = ProgrammeSolver()
        self._retreat = Retreat(robot.length, robot.limits.tension_max, rest_tip(robot)[0])
        self._release = Release()
        self.reset()

    def reset(self, displacement: np.ndarray | None = None) -> None:
        """Forget all earlier steps.

        Rate limits count from `displacement` (m,) in m; None: from the displacements of the cables' paths at the next step.
        """
        self._solver.reset()
        self._damping = StepDamping(self.robot.length)
        self._retreat.reset()
        self._release.forget()
        self._displacement: np.ndarray | None = None if displacement is None else np.array(displacement, dtype=float)
        self._tension = self._change = np.zeros(len(self.robot.cables))
        self._missed, self._held = 0.0, False

    def step(
        self,
        response: "Response",
        target: Target,
        *,
        backbone_station: np.ndarray,
        tension: np.ndarray | None = None,
        interval: float = 0.01,
        followed: bool = True,
        contact: ObstacleForces | None = None,
        gravity: np.ndarray | None = None,
    ) -> Command:
        """Return the command that brings the modelled robot nearest to the target.

        Never raises for a hard problem; the command's code says what happened.

        Parameters
        ----------
        response
            Linear response of the model at its present shape.
        target
            Shape to keep.
        backbone_station
            (n,) stations of the response's backbone rows.
        tension
            (m,) present tensions of the model in N; None: those of the last command.
        interval
            Time since the last step in s.
        followed
            Whether the model's shape is its equilibrium under the last command; False: it found none and kept its last shape.
        contact
            What the modelled robot leans on; a target that it then misses has the code CONTACT.
        gravity
            (3,) in m/s^2, which places what is fixed in the world; None: that of the horizontal robot.

        """
        started = time.perf_counter()
        limits, options = self.robot.limits, self.options
        tension = self._tension if tension is None else np.asarray(tension, dtype=float)
        previous = self._displacement
        if previous is None:
            previous = response.compliance_aa @ tension + response.displacement_free
        last = previous
        if self._rigging.has_coupled:
            # A slack antagonist is far longer than its path and follows its motor: its path is free, whatever the winch reaches.
            path = response.compliance_aa @ tension + response.displacement_free
            previous = np.where(self._rigging.coupled, np.maximum(previous, path), previous)
        interval = min(max(interval, 0.0), self._longest_interval(response))
        tip = _tip(response, tension)
        move = self._retreat.move(followed, target, tip, tension)
        if followed:
            interval *= self._retreat.stride
        if move != Move.ONWARD:
            return self._recovery_command(move, followed, response, target, previous, tension, interval, started)
        forces = ObstacleForces.none() if contact is None else contact
        release = self._release_from(target, forces, tension, tip, gravity)
        demands = self._surroundings.demands(response, tension, backbone_station, gravity, forces, options.max_contact_force)
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
                options=self._options_at(release is None and (len(forces) > 0 or self._held)),
                least_tension=self._rigging.least_tension(options.pretension),
                couplings=self._rigging.couplings,
                around=rows_of(demands),
                release=release,
            )
            solution = self._solver.solve(programme)
        except SolverFailed as error:
            self._retreat.observe(np.zeros(len(previous)), interval)  # counts as at rest
            return Command(
                displacement=previous,
                tension=tension,
                code=ControllerCode.SOLVER_FAILED,
                message=f"{error}; the last command is kept",
                solve_time=time.perf_counter() - started,
            )
        result = outcome(
            np.ascontiguousarray(response.compliance_aa),
            response.displacement_free,
            np.ascontiguousarray(response.compliance_ea),
            response.effector_free,
            tension,
            (solution.unknowns, solution.multipliers, programme.scale, programme.tension_lower, programme.tension_upper),
            self._slack,
            previous,
            self._change,
            (limits.displacement_rate * interval, limits.displacement_min, limits.displacement_max),
            limits.tension_max,
            target.tip_position,
            target.direction_or_zeros,
        )
        displacement = self._rigging.possible(result.displacement, result.tension)
        errors = result.errors
        self._damping.observe(result.along, result.lengths)
        around = self._surroundings.met(demands, result.tension - tension)
        self._retreat.observe(displacement - last, interval, around.holds)
        if self._retreat.stride < 1.0:
            result.met[0] = False  # the shorter stride limits the step, not the motors
        missed = max(
            errors.distance * (target.tip_position_weight > 0.0), backbone_missed(result.effector, target, backbone_station)
        )
        self._missed, self._held = missed, around.holds
        code, message = evaluate(
            target=target,
            points_missed=missed,
            tilt=errors.tilt,
            met=result.met if result.any_met else None,
            names=self._names,
            tolerance=options.tolerance_of(self.robot.length),
            tilt_tolerance=options.tilt_tolerance,
            contact=forces.sentence,
            around=around,
        )
        self._displacement, self._tension, self._change = displacement, result.tension, result.change
        return Command(
            displacement=displacement,
            tension=result.tension,
            code=code,
            message=message,
            distance=errors.distance,
            lateral=errors.lateral,
            axial=errors.axial,
            tilt=errors.tilt,
            tip=result.effector[:3],
            forces=forces,
            solve_time=time.perf_counter() - started,
        )

    def _release_from(
        self, target: Target, forces: ObstacleForces, tension: np.ndarray, tip: np.ndarray, gravity: np.ndarray | None
    ) -> ReleaseErrors | None:
        """Return what lets the robot go from the obstacles that keep it from its target; None: none does.

        tension (m,) in N, tip (3,) in m and gravity (3,) in m/s^2: present ones.
        """
        scene = self._surroundings.scene
        if scene is None or not len(forces) or self._missed <= self.options.tolerance_of(self.robot.length):
            self._release.forget()
            return None
        errors = self._release.errors(scene, forces, tension, target.tip_position - tip, gravity)
        return errors if len(errors.offset) else None

    def _options_at(self, held: bool) -> InverseOptions:
        """Return the options of a step; held: what is around the robot may keep it from its target.

        Then the nearest shape is sought also along the robot, by as much as the last step missed the target by more than the
        tolerance: otherwise the cables would pull the robot together to come a little nearer across it.
        """
        options, tolerance = self.options, self.options.tolerance_of(self.robot.length)
        if not held or self._missed <= tolerance:
            return options
        share = min(1.0, self._missed / tolerance - 1.0)
        return dataclasses.replace(
            options,
            axial_weight=options.axial_weight + share * (1.0 - options.axial_weight),
            energy_weight=options.energy_weight * _MORE_ENERGY**share,
        )

    @property
    def _slack(self) -> float:
        """Slack in m of an idle cable."""
        return self.options.slack_of(self.robot.length)

    def _longest_interval(self, response: "Response") -> float:
        """Return the time in s in which no winch alone moves the tip farther than `_FARTHEST` of the length."""
        speed = self.robot.limits.displacement_rate * tip_over_cable(response.compliance_ea, response.compliance_aa)
        return _FARTHEST * self.robot.length / speed if speed > 0.0 else _LONGEST_INTERVAL

    def _recovery_command(
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
        """Return the command of a move that does not go toward the target."""
        if move == Move.BACK:
            # Back to the present shape, whichever command it belongs to: the model may be one sample behind.
            path = response.compliance_aa @ tension + response.displacement_free
            shape = np.where(tension > 0.0, path, path - self._slack)
            displacement = self._rigging.possible(within_limits(shape, previous, self.robot.limits, interval), tension)
            code, message = (
                ControllerCode.UNREACHABLE,
                "the model finds no equilibrium on the way to the target: the last shape is kept",
            )
        else:
            # Near a limit point the linear response is a poor estimate of the free displacements; on the straight robot they
            # are 0.
            free = response.displacement_free if followed else np.minimum(response.displacement_free, 0.0)
            displacement = self._rigging.paid_out(free - self._slack, previous, interval)
            code = ControllerCode.RELAXING
            if followed:
                message = "the target cannot be approached from here: paying the cables out to try again nearer to rest"
            else:
                message = "the model finds no equilibrium: paying the cables out"
        self._displacement, self._tension = displacement, tension
        self._damping = StepDamping(self.robot.length)  # the old factor belongs to another shape
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
        """Return the command that pays the cables out, within their rate limits, until none of them has tension."""
        started = time.perf_counter()
        free = response.displacement_free
        previous = free - self._slack if self._displacement is None else self._displacement
        interval = min(max(interval, 0.0), _LONGEST_INTERVAL)
        displacement = self._rigging.paid_out(free - self._slack, previous, interval)
        self.reset(displacement)
        # Antagonists cannot both be paid out: they are as slack as they can be where their motor no longer moves.
        at_rest = bool(np.abs(displacement - previous).max(initial=0.0) < 1e-6)
        relaxed = bool(np.all(displacement <= free - self._slack + 1e-6)) or (self._rigging.shared and at_rest)
        return Command(
            displacement=displacement,
            tension=np.zeros(free.size),
            code=ControllerCode.RELAXING,
            message="the cables are paid out" if relaxed else "paying the cables out",
            solve_time=time.perf_counter() - started,
        )


def _tip(response: "Response", tension: np.ndarray) -> np.ndarray:
    """Return the position (3,) of the tip under the tensions (m,)."""
    return response.compliance_ea[:3] @ tension + response.effector_free[:3]
