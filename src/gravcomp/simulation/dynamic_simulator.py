"""A robot in motion as one object: gravity, cables and time in, shape out."""

import dataclasses
import math
import time
from typing import TYPE_CHECKING

import numpy as np

from gravcomp.description import Robot
from gravcomp.full_model.cable_input import CableInput
from gravcomp.full_model.dynamics import DynamicSolver
from gravcomp.full_model.generalized_alpha import DynamicsOptions
from gravcomp.full_model.model import RobotModel
from gravcomp.full_model.motion import Motion
from gravcomp.full_model.observation import observe
from gravcomp.full_model.shape import Shape, ShapeStatus
from gravcomp.simulation.simulator import Simulator

if TYPE_CHECKING:
    from gravcomp.reduction.motion import ReducedDynamicSolver, ReducedMotion
    from gravcomp.reduction.reduced_model import ReducedModel
    from gravcomp.reduction.serving import ReducedServing

# Distance of the two models' tips, as a fraction of the length, up to which the reduced one takes over.
_AGREEMENT = 5e-4
# Steps of the full model until the reduced one is tried again.
_RETURN_AFTER = 25
# How often a time step that does not converge is halved.
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
    """Motion of a robot. The shape is the moving one; its response is that of the equilibrium toward which it moves,
    because that is what a controller of shapes can steer: the answer within one step is mostly inertia.

    The reduced model moves while it also serves the equilibrium, whose error it knows, and stays within what it was trained
    for; else the full one does.
    """

    def __init__(self, robot: Robot | RobotModel, options: DynamicsOptions = DynamicsOptions(), reduced: bool = True):
        """`reduced`: use the reduced model where one is built. Raises MeshError for a body that cannot be computed with."""
        self.statics = Simulator(robot, reduced)
        self.model, self.robot = self.statics.model, self.statics.robot
        self.options = options
        self.solver = DynamicSolver(self.model, options)
        self._reduced, self._momentum = self._reduced_solver(self.statics.reduced_model)
        self._in_reduced, self._wait = False, 0

    def load_reduced(self) -> "_LoadedMotion | None":
        """As `Simulator.load_reduced`, with the motion."""
        serving = self.statics.load_reduced()
        return serving and _LoadedMotion(serving, *self._reduced_solver(serving.reduced))

    def adopt(self, loaded: "_LoadedMotion") -> None:
        """As `Simulator.adopt`."""
        self.statics.adopt(loaded.serving)
        self._reduced, self._momentum = loaded.solver, loaded.momentum

    @property
    def displacements(self) -> np.ndarray:
        """(nodes, 3) displacements of the mesh's nodes at the present shape, in m."""
        return self._lifted(self._reduced.state.q) if self._in_reduced else self.solver.state.u

    def reset(self) -> None:
        """Back to the straight robot at rest."""
        self.statics.reset()
        self._place(np.zeros_like(self.model.mesh.nodes), np.zeros(self.model.tendons.count), np.zeros(3))

    def let_go(self, gravity: np.ndarray) -> None:
        """Back to the straight robot at rest, on which gravity (3,) acts from now on."""
        self.statics.reset()
        self._place(np.zeros_like(self.model.mesh.nodes), np.zeros(self.model.tendons.count), np.asarray(gravity, dtype=float))

    def settle(self, gravity: np.ndarray, displacement: np.ndarray | None = None) -> Shape:
        """At rest in the equilibrium under gravity (3,) and displacement (m,); motion starts from there."""
        shape = self.statics.solve(gravity, displacement)
        self._place(self.statics.displacements, shape.cable_tension, np.asarray(gravity, dtype=float))
        return shape

    def step(
        self,
        gravity: np.ndarray,
        displacement: np.ndarray | None = None,
        tension: np.ndarray | None = None,
        duration: float | None = None,
    ) -> Shape:
        """Move on by `duration` seconds (default: one time step), in equal steps no longer than the options' time step.

        The other arguments are those of `Simulator.step`.
        """
        started = time.perf_counter()
        equilibrium = self.statics.step(gravity, displacement, tension)
        gravity, cables = self.statics.checked(gravity, displacement, tension)
        duration = self.options.time_step if duration is None else duration
        count = max(1, math.ceil(duration / self.options.time_step - 1e-6))
        motion = self._move(gravity, cables, duration / count, count)
        model = self.model
        if self._in_reduced:
            sections, _, _, orientation = self._reduced.model.observe(motion.q, np.zeros((0, motion.q.size)))
        else:
            sections = model.effectors.sections(model.mesh.nodes + motion.u)
            _, _, orientation = observe(sections, np.zeros((*sections.shape, 0)))
        ok = motion.converged
        return dataclasses.replace(
            equilibrium,
            tip_position=sections[-1, 0],
            tip_orientation=orientation[-1],
            backbone_position=sections[:-1, 0],
            backbone_orientation=orientation[:-1],
            cable_displacement=motion.tendons.displacement + model.tendons.axial_compliance * motion.tension,
            cable_tension=motion.tension,
            residual=motion.residual,
            solve_time=time.perf_counter() - started,
            model="reduced" if self._in_reduced else "full",
            status=equilibrium.status if ok else ShapeStatus.NOT_CONVERGED,
            message=equilibrium.message if ok else "a time step did not converge; the last shape is kept",
        )

    def _move(self, gravity: np.ndarray, cables: CableInput, h: float, count: int) -> "Motion | ReducedMotion":
        """The motion after `count` steps of h seconds, by the reduced model if it may."""
        self._wait -= 1
        if self._may_reduce():
            before = self._reduced.state
            motion = _advanced(self._reduced, gravity, cables, h, count)
            if motion.converged and self._reduced.model.outside(motion.q) <= 1.0:
                return motion
            self._reduced.state, self._wait = before, _RETURN_AFTER
        if self._in_reduced:
            last = self._reduced.state
            self.solver.take_over(*(self._lifted(x) for x in (last.q, last.velocity, last.acceleration)), last.tension)
            self._in_reduced = False
        return _advanced(self.solver, gravity, cables, h, count)

    def _may_reduce(self) -> bool:
        """Whether the reduced model may move; where the full one did until now, the reduced one is put where that is."""
        if self._reduced is None or self.statics.reduced_model is None:
            return False
        if not self._in_reduced and self._wait <= 0:
            self._wait = _RETURN_AFTER
            last, free, reduced = self.solver.state, self.model.free, self._reduced.model
            q = reduced.coordinates_of @ free(last.u)
            tip = self.model.effectors.sections(self.model.mesh.nodes + last.u)[-1, 0]
            if np.linalg.norm(reduced.tip(q) - tip) < _AGREEMENT * self.model.length:
                self._reduced.take_over(
                    q, self._momentum @ free(last.velocity), self._momentum @ free(last.acceleration), last.tension
                )
                self._in_reduced = True
        return self._in_reduced

    def _place(self, u: np.ndarray, tension: np.ndarray, gravity: np.ndarray) -> None:
        """At rest at the displacements u (n, 3)."""
        self._in_reduced, self._wait = False, 0
        self.solver.place(u, tension, gravity)

    def _lifted(self, q: np.ndarray) -> np.ndarray:
        """The field (n, 3) of the reduced coordinates q (r,)."""
        field = np.zeros_like(self.model.mesh.nodes)
        self.model.free(field)[:] = self._reduced.model.basis @ q
        return field

    def _reduced_solver(self, reduced: "ReducedModel | None") -> "tuple[ReducedDynamicSolver | None, np.ndarray | None]":
        """The reduced model's motion, and the matrix (r, 3 n_free) to the coordinates' velocity of the same momentum; None
        without a reduced model, and where the materials do not damp and creep alike.
        """
        laws = {(m.damping_time, m.creep_ratio, m.creep_time) for m in self.model.mesh.materials}
        if reduced is None or (len(laws) > 1 and self.options.damping == "kelvin_voigt"):
            return None, None
        from gravcomp.reduction.motion import ReducedDynamicSolver

        weighted = self.model.mass_matrix().multiply(reduced.basis)
        mass = reduced.basis.T @ weighted
        damping_time, *creep = laws.pop()
        solver = ReducedDynamicSolver(reduced, mass, damping_time, self.model.length, self.options, creep=tuple(creep))
        return solver, np.linalg.solve(mass, weighted.T)


def _advanced(
    solver: "DynamicSolver | ReducedDynamicSolver",
    gravity: np.ndarray,
    cables: CableInput,
    h: float,
    count: int = 1,
    halvings: int = _HALVINGS,
) -> "Motion | ReducedMotion":
    """`count` steps of h seconds, each in halves where Newton's method does not settle; the last state where that does not help."""
    for _ in range(count):
        motion = solver.step(gravity, cables, h)
        if not motion.converged and halvings > 0:
            motion = _advanced(solver, gravity, cables, h / 2.0, 2, halvings - 1)
        if not motion.converged:
            break
    return motion
