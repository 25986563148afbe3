"""Simulation of a robot in motion as one object: gravity, cables and time in, shape out."""

import dataclasses
import math
import time
from typing import TYPE_CHECKING

import numpy as np

from gravcomp.description import Robot
from gravcomp.full_model.cable_input import CableInput
from gravcomp.full_model.dynamics import DynamicSolver
from gravcomp.full_model.generalized_alpha import DynamicsOptions
from gravcomp.full_model.motion import ExternalForce, Motion
from gravcomp.full_model.observation import observe
from gravcomp.full_model.payload import with_payload
from gravcomp.full_model.robot_model import RobotModel
from gravcomp.full_model.shape import Shape, ShapeStatus
from gravcomp.full_model.wrench import PointLoads, Wrench
from gravcomp.mechanics.total_lagrangian import SolidElements
from gravcomp.simulation.simulator import Simulator

if TYPE_CHECKING:
    from gravcomp.reduction.motion import ReducedDynamicSolver, ReducedMotion
    from gravcomp.reduction.reduced_loads import ReducedLoads
    from gravcomp.reduction.reduced_model import ReducedModel
    from gravcomp.reduction.serving import ReducedServing

# Largest distance between the tips of the two models, as a fraction of the length, at which the reduced model takes over.
_AGREEMENT = 5e-4
# Steps of the full model before the reduced model is tried again.
_RETURN_AFTER = 25
# Largest number of times that a time step is halved if it does not converge.
_HALVINGS = 4


@dataclasses.dataclass(frozen=True)
class _LoadedMotion:
    """A reduced model that was loaded for a running simulator; solver and momentum as in `DynamicSimulator._reduced_solver`."""

    serving: "ReducedServing"
    solver: "ReducedDynamicSolver | None"
    momentum: "np.ndarray | None"

    def warm_up(self) -> None:
        """As `ReducedServing.warm_up`."""
        self.serving.warm_up()


class DynamicSimulator:
    """Motion of a robot.

    The shape is that of the moving robot. Its response is that of the equilibrium toward which it moves, because a controller
    of shapes controls the equilibrium: the response within one step is mostly inertia. The reduced model is used for the motion
    while it is used for the equilibrium, where its error is measured, and stays within its trained range; otherwise the full
    model is used.
    """

    def __init__(self, robot: Robot | RobotModel, options: DynamicsOptions | None = None, reduced: bool = True):
        """options: default `DynamicsOptions()`; reduced: use the reduced model if one is built.

        Raises MeshError for a body that cannot be meshed or computed.
        """
        self.statics = Simulator(robot, reduced)
        self.model, self.robot = self.statics.model, self.statics.robot
        self.options = options or DynamicsOptions()
        self.solver = DynamicSolver(self.model, self.options)
        self._reduced, self._momentum = self._reduced_solver(self.statics.reduced_model)
        self._in_reduced, self._wait = False, 0
        self._loads: tuple[ReducedDynamicSolver, ReducedLoads] | None = None  # projected on this solver's basis
        # Of the reduced model, while the full one computes the motion; None: not known.
        self._memory = self._reduced.state.memory if self._reduced else None

    def load_reduced(self) -> "_LoadedMotion | None":
        """As `Simulator.load_reduced`, with the motion."""
        serving = self.statics.load_reduced()
        return None if serving is None else _LoadedMotion(serving, *self._reduced_solver(serving.reduced))

    def adopt(self, loaded: "_LoadedMotion") -> None:
        """As `Simulator.adopt`."""
        self.statics.adopt(loaded.serving)
        self._reduced, self._momentum = loaded.solver, loaded.momentum

    @property
    def displacements(self) -> np.ndarray:
        """Displacements (nodes, 3) of the mesh's nodes at the present shape, in m."""
        reduced = self._active_reduced
        return self.solver.state.u if reduced is None else self._lifted(reduced, reduced.state.q)

    @property
    def _active_reduced(self) -> "ReducedDynamicSolver | None":
        """The reduced model's solver while it computes the motion; None while the full model does."""
        return self._reduced if self._in_reduced else None

    def tip_compliance(self) -> np.ndarray:
        """As `Simulator.tip_compliance`, of the equilibrium toward which the robot moves."""
        return self.statics.tip_compliance()

    def warm_up(self) -> None:
        """As `Simulator.warm_up`, with the motion; afterwards the robot is straight and at rest."""
        self.statics.warm_up()
        reduced, self._reduced = self._reduced, None
        try:
            self._release_and_hold()  # with the full model, which takes over where the reduced one ends
        finally:
            self._reduced = reduced
        if reduced is not None:
            self.reset()
            self._release_and_hold()
        self.reset()

    def _release_and_hold(self) -> None:
        """Step with cables that are released and with slack ones."""
        for displacement in (None, np.zeros(self.model.tendons.count)):
            self.step(np.zeros(3), displacement)

    def reset(self) -> None:
        """Return to the straight robot at rest, without gravity."""
        self.statics.reset()
        self._place(np.zeros_like(self.model.mesh.nodes), np.zeros(self.model.tendons.count), np.zeros(3))

    def let_go(self, gravity: np.ndarray) -> None:
        """Return to the shape at rest without load, on which gravity (3,) acts from now on."""
        self.statics.reset()
        self._place(np.zeros_like(self.model.mesh.nodes), np.zeros(self.model.tendons.count), np.asarray(gravity, dtype=float))

    def settle(self, gravity: np.ndarray, displacement: np.ndarray | None = None) -> Shape:
        """Go to rest in the equilibrium under gravity (3,) and displacement (m,); motion starts from there."""
        shape = self.statics.solve(gravity, displacement)
        self._place(self.statics.displacements, shape.cable_tension, np.asarray(gravity, dtype=float))
        return shape

    def step(
        self,
        gravity: np.ndarray,
        displacement: np.ndarray | None = None,
        tension: np.ndarray | None = None,
        duration: float | None = None,
        wrench: Wrench | tuple[Wrench, ...] | None = None,
    ) -> Shape:
        """Move on by `duration` s (default: one time step), in equal steps that are not longer than the options' time step.

        The other arguments are those of `Simulator.step`.
        """
        started = time.perf_counter()
        equilibrium = self.statics.step(gravity, displacement, tension, wrench=wrench)
        gravity, cables = self.statics.checked(gravity, displacement, tension)
        duration = self.options.time_step if duration is None else duration
        count = max(1, math.ceil(duration / self.options.time_step - 1e-6))
        motion = self._move(gravity, cables, duration / count, count, PointLoads.of(self.model, wrench))
        model = self.model
        reduced = self._active_reduced
        if reduced is not None:
            q = reduced.state.q
            sections, _, _, orientation = reduced.model.observe(q, np.zeros((0, q.size)))
        else:
            sections = model.effectors.sections(model.mesh.nodes + self.solver.state.u)
            _, _, orientation = observe(sections, np.zeros((*sections.shape, 0)))
        ok = motion.converged
        stretch = model.tendons.axial_compliance * motion.tendons.mean_share
        return dataclasses.replace(
            equilibrium,
            tip_position=sections[-1, 0],
            tip_orientation=orientation[-1],
            backbone_position=sections[:-1, 0],
            backbone_orientation=orientation[:-1],
            cable_displacement=motion.tendons.displacement + stretch * motion.tension,
            cable_tension=motion.tension,
            residual=motion.residual,
            solve_time=time.perf_counter() - started,
            model="reduced" if self._in_reduced else "full",
            status=equilibrium.status if ok else ShapeStatus.NOT_CONVERGED,
            message=equilibrium.message if ok else "a time step did not converge; the last shape is kept",
        )

    def _move(
        self, gravity: np.ndarray, cables: CableInput, h: float, count: int, loads: PointLoads | None
    ) -> "Motion | ReducedMotion":
        """Return the motion after `count` steps of h seconds, computed with the reduced model if possible."""
        self._wait -= 1
        reduced = self._usable_reduced()
        if reduced is not None:
            before = reduced.state
            motion = _advanced(
                reduced, gravity, cables, h, count, external=self._external(with_payload(self.model, gravity, loads), reduced)
            )
            if motion.converged and reduced.model.outside(reduced.state.q) <= 1.0:
                return motion
            reduced.state, self._wait = before, _RETURN_AFTER
        left = self._active_reduced
        if left is not None:
            q, velocity, acceleration = (
                self._lifted(left, x) for x in (left.state.q, left.state.velocity, left.state.acceleration)
            )
            held = None
            if left.state.memory.ratio.size:
                assert isinstance(self.model.elements, SolidElements)  # others are not reduced
                held = left.state.memory.at_points(self.model.elements, left.model.basis)[1]
            self.solver.take_over(q, velocity, acceleration, left.state.tension, held)
            self._in_reduced, self._memory = False, left.state.memory
        motion = _advanced(self.solver, gravity, cables, h, count, external=None if loads is None else loads.at)
        if self._memory is not None and self._reduced is not None and self._memory.ratio.size:
            self._memory = self._memory.after(*self._reduced.model.projected(self.model.free(self.solver.state.u)), count * h)
        return motion

    def _external(self, loads: PointLoads | None, reduced: "ReducedDynamicSolver") -> ExternalForce | None:
        """Return the force of the loads on the reduced coordinates."""
        if loads is None:
            return None
        from gravcomp.reduction.reduced_loads import ReducedLoads

        if self._loads is None or self._loads[0] is not reduced:
            self._loads = reduced, ReducedLoads(self.model, reduced.model.basis)
        projected = self._loads[1]
        return lambda q: projected.at(loads, q)

    def _usable_reduced(self) -> "ReducedDynamicSolver | None":
        """Return the reduced model's solver if it may be used; if the full model was used before, at the full model's state."""
        if self._reduced is None or self._momentum is None or self.statics.reduced_model is None:
            return None
        if not self._in_reduced and self._wait <= 0:
            self._wait = _RETURN_AFTER
            last, free, reduced = self.solver.state, self.model.free, self._reduced.model
            q = reduced.coordinates_of @ free(last.u)
            tip = self.model.effectors.sections(self.model.mesh.nodes + last.u)[-1, 0]
            if np.linalg.norm(reduced.tip(q) - tip) < _AGREEMENT * self.model.length:
                velocity, acceleration = self._momentum @ free(last.velocity), self._momentum @ free(last.acceleration)
                self._reduced.take_over(q, velocity, acceleration, last.tension, self._memory)
                self._in_reduced = True
        return self._active_reduced

    def _place(self, u: np.ndarray, tension: np.ndarray, gravity: np.ndarray) -> None:
        """Go to rest at the displacements u (n, 3)."""
        self._in_reduced, self._wait = False, 0
        self.solver.place(u, tension, gravity)
        self._memory = None
        if self._reduced is not None:
            self._memory = self._reduced.state.memory.relaxed(*self._reduced.model.projected(self.model.free(u)))

    def _lifted(self, reduced: "ReducedDynamicSolver", q: np.ndarray) -> np.ndarray:
        """Return the field (n, 3) of the reduced coordinates q (r,)."""
        field = np.zeros_like(self.model.mesh.nodes)
        self.model.free(field)[:] = reduced.model.basis @ q
        return field

    def _reduced_solver(self, reduced: "ReducedModel | None") -> "tuple[ReducedDynamicSolver | None, np.ndarray | None]":
        """Return the reduced model's solver and the matrix (r, 3 n_free) to the coordinates' velocity of the same momentum.

        Both are None without a reduced model, and if the materials differ in damping or creep.
        """
        laws = {(m.damping_time, m.branches) for m in self.model.mesh.materials}
        if reduced is None or (len(laws) > 1 and self.options.damping == "kelvin_voigt"):
            return None, None
        from gravcomp.reduction.motion import ReducedDynamicSolver

        weighted = self.model.mass_matrix().multiply(reduced.basis)
        mass = reduced.basis.T @ weighted
        damping_time, branches = laws.pop()
        solver = ReducedDynamicSolver(reduced, mass, damping_time, self.model.length, self.options, branches=branches)
        return solver, np.linalg.solve(mass, weighted.T)


def _advanced(
    solver: "DynamicSolver | ReducedDynamicSolver",
    gravity: np.ndarray,
    cables: CableInput,
    h: float,
    count: int = 1,
    halvings: int = _HALVINGS,
    external: ExternalForce | None = None,
) -> "Motion | ReducedMotion":
    """Take `count` steps of h seconds, halved if Newton's method does not converge; return the last motion."""
    for _ in range(count):
        motion = solver.step(gravity, cables, h, external)
        if not motion.converged and halvings > 0:
            motion = _advanced(solver, gravity, cables, h / 2.0, 2, halvings - 1, external)
        if not motion.converged:
            break
    return motion
