"""Quasi-static simulation of a robot as one object: gravity and cables in, shape and response out."""

import contextlib
import dataclasses
import math
import time
from typing import TYPE_CHECKING

import numpy as np

from gravcomp.contact.contacts import Contacts
from gravcomp.contact.start import refuse_start
from gravcomp.description import Robot
from gravcomp.full_model.cable_input import CableInput
from gravcomp.full_model.contact import FullContact
from gravcomp.full_model.creep import Creep
from gravcomp.full_model.equilibrium import Equilibrium
from gravcomp.full_model.law_range import beyond_range
from gravcomp.full_model.linear_response import observed
from gravcomp.full_model.robot_model import RobotModel
from gravcomp.full_model.shape import Shape, ShapeStatus
from gravcomp.full_model.statics import StaticSolver
from gravcomp.full_model.wrench import Load, PointLoads
from gravcomp.mechanics.block_matrix import NotPositiveDefinite
from gravcomp.mesh.mesh import MeshError
from gravcomp.simulation.search_pace import SearchPace

if TYPE_CHECKING:
    from gravcomp.reduction.reduced_model import ReducedModel
    from gravcomp.reduction.serving import ReducedServing
    from gravcomp.scene.scene import Scene

_MORE_ITERATIONS = 12
_SMALL_PULL = 1e-4  # of the length: taut cables that hardly deform the robot
_SHORT_STEP = 0.01  # s
_LIMIT_POINT = "the robot has no equilibrium beyond it, or only at a distant shape"


class Simulator:
    """Quasi-static simulation of a robot.

    `step` uses the reduced model if one is built and its error is small, else the full model; `solve` uses the full model.

    >>> from gravcomp.description import load_robot_file
    >>> simulator = Simulator(load_robot_file("article").robot, reduced=False)
    >>> shape = simulator.solve(np.array([-9.81, 0.0, 0.0]))  # m/s^2 in soft_base: the robot is horizontal
    >>> bool(shape.is_equilibrium), float((1e3 * shape.tip_position[0]).round(1))  # mm
    (True, -27.9)
    """

    def __init__(self, robot: Robot | RobotModel, reduced: bool = True, scene: "Scene | None" = None, searches: bool = True):
        """reduced: use the reduced model if one is built; scene: what the robot touches; searches: `step` may search.

        Raises MeshError for a body that cannot be meshed or computed, ValueError for one that has no contact, ConfigError for a
        scene in which the robot cannot be.
        """
        self.model = robot if isinstance(robot, RobotModel) else RobotModel(robot)
        self.robot = self.model.robot
        self.solver = StaticSolver(self.model)
        self.scene = scene
        if scene:
            refuse_start(scene, self.robot)
            self.solver.contact = FullContact(self.model, scene)
        self._creep, self._searches = Creep(self.model), searches
        self._pace = SearchPace(self.model.length)
        self._serving = self.load_reduced() if reduced else None

    def load_reduced(self) -> "ReducedServing | None":
        """Return the reduced model of this robot, ready to use; None if none is stored. May run in its own thread."""
        from gravcomp.reduction.serving import ReducedServing
        from gravcomp.reduction.store import load

        reduction = load(self.model)
        return (
            None
            if reduction is None
            else ReducedServing(self.model, reduction.reduced_model(self.model), self.solver, self._creep)
        )

    def adopt(self, serving: "ReducedServing") -> None:
        """Use `serving`, from `load_reduced`, as soon as it agrees with the full model: the shape does not jump."""
        serving.stand_by()
        self._serving = serving

    @property
    def reduced_model(self) -> "ReducedModel | None":
        """The reduced model while it is used; None while the full model is."""
        return self._serving.reduced if self._serving and self._serving.trusted else None

    @property
    def displacements(self) -> np.ndarray:
        """Displacements (nodes, 3) of the mesh's nodes at the present shape, in m."""
        if self._serving and self._serving.trusted:
            return self._serving.displacements
        return self.solver.state.u

    def reset(self) -> None:
        """Return to the straight robot, relaxed."""
        self.solver.reset()
        self._creep.relax(self.solver.state.u)
        self._pace.reset()
        if self._serving:
            self._serving.reset()

    def warm_up(self) -> None:
        """Compile the functions of a step, or load them from the cache; afterwards the robot is straight.

        Cables that are released, slack, pulled in and paid out again use different functions; so does a body that creeps.
        """
        if self.solver.contact is not None and self.solver.contact.own is not None:
            self.solver.contact.own.warm_up()
        self._pull_and_release()
        if self._serving:
            # The full model measures the reduced one's error and takes over from it: its first step must not stop the loop.
            serving, self._serving = self._serving, None
            try:
                self._pull_and_release()
            finally:
                self._serving = serving
        self.reset()

    def _pull_and_release(self) -> None:
        """Step with cables that are released, slack, pulled in and paid out again."""
        slack = np.zeros(self.model.tendons.count)
        for displacement in (None, slack, slack + _SMALL_PULL * self.model.length, slack):
            shape = self.step(np.zeros(3), displacement, duration=_SHORT_STEP)
            if shape.cable_tension.any():
                with contextlib.suppress(NotPositiveDefinite, MeshError):  # a body without a section at its end has none
                    self.solver.tip_compliance()  # a step keeps its tangent while the shape hardly changes; this assembles it

    def step(
        self,
        gravity: np.ndarray,
        displacement: np.ndarray | None = None,
        tension: np.ndarray | None = None,
        duration: float | None = None,
        wrench: Load | tuple[Load, ...] | None = None,
        later: bool = False,
    ) -> Shape:
        """Track the equilibrium from the last shape, for changes of the size of a control step.

        If the equilibrium is lost, it is searched for in parts of the change of load, then from the straight robot, but only
        occasionally (see `SearchPace`). If none is found or searched for, the last shape is returned with the status
        NOT_CONVERGED.

        gravity (3,) in m/s^2; displacement (m,) in m, positive: pulled in, NaN: released; or tension (m,) in N; neither: all
        cables are released. duration: s since the last step, in which a body with creep has crept (`full_model.creep`); None:
        the body has relaxed, as after a long time. wrench: external forces and moments on cross-sections. later: where the
        reduced model's error is due to be measured, which takes as long as a step of the full model, leave that to
        `measure_error`, or else to the next step. Raises ValueError for wrong lengths, numbers that are not finite, negative
        tensions, and a duration that is not positive.
        """
        started = time.perf_counter()
        gravity, cables = self.checked(gravity, displacement, tension)
        if duration is not None and not 0.0 < duration < math.inf:
            raise ValueError(f"duration is {duration} s; a positive number is needed")
        h = duration if self._creep.exists else None
        loads = PointLoads.of(self.model, wrench)
        shape = self._serving.step(gravity, cables, h, loads, later) if self._serving else None
        if shape is not None:
            self._pace.found(gravity, cables)
            return shape
        before, sliding = self.solver.state, self.solver.sliding
        self.solver.viscous = None if h is None else self._creep.step(h)
        state = self.solver.track(gravity, cables, loads=loads)
        if not state.converged:
            # More iterations find an equilibrium that is near; if the tangent is not positive definite, none is.
            state = self.solver.track(gravity, cables, iterations=_MORE_ITERATIONS, stable=True, loads=loads)
        if not state.converged and self._searches and self._pace.may_search(gravity, cables):
            last = self._pace.last_gravity
            self.solver.state, self.solver.sliding = before, sliding
            if last is not None and loads is None:
                state = self.solver.approach(last, gravity, cables)
            if not state.converged:
                state = self.solver.solve(gravity, cables, wrench=wrench)
        elif not state.converged:
            state = dataclasses.replace(before, residual=state.residual, converged=False, load_fraction=1.0)
        if state.converged:
            self._pace.found(gravity, cables)
        else:
            self.solver.state, self.solver.sliding = before, sliding
        self._remember(self.solver.state.u, h)
        shape = self._shape(state, gravity, started)
        if not self._serving:
            return shape
        reason = self._serving.reason
        self._serving.take_over(state, gravity, cables, h, loads)
        if shape.status != ShapeStatus.OK:
            return shape
        return dataclasses.replace(shape, status=ShapeStatus.FALLBACK, message=f"{reason}: the full model is used")

    def measure_error(self) -> None:
        """Measure the reduced model's error at the last shape if a step has left that for later; see `step`."""
        if self._serving:
            self._serving.measure()

    def tip_compliance(self) -> np.ndarray:
        """Return the displacement of the tip (3, 3) m/N by forces on it at given tensions, at the present shape.

        Raises NotPositiveDefinite where the shape is not stable.
        """
        return self._serving.tip_compliance() if self._serving and self._serving.trusted else self.solver.tip_compliance()

    def solve(
        self,
        gravity: np.ndarray,
        displacement: np.ndarray | None = None,
        tension: np.ndarray | None = None,
        wrench: Load | tuple[Load, ...] | None = None,
    ) -> Shape:
        """Return the equilibrium found from the straight robot, independent of all earlier shapes.

        The arguments are those of `step`.
        """
        started = time.perf_counter()
        gravity, cables = self.checked(gravity, displacement, tension)
        self.solver.reset()
        self.solver.viscous = None
        state = self.solver.solve(gravity, cables, wrench=wrench)
        self._remember(state.u, None)
        self._pace.reset()
        if state.converged:
            self._pace.found(gravity, cables)
        if self._serving:
            self._serving.follow(state, gravity, cables, loads=PointLoads.of(self.model, wrench))
        return self._shape(state, gravity, started)

    def checked(
        self, gravity: np.ndarray, displacement: np.ndarray | None, tension: np.ndarray | None
    ) -> tuple[np.ndarray, CableInput]:
        """Return gravity and cable input as arrays; raises ValueError as `step` does."""
        gravity = _vector("gravity", gravity, 3)
        count = self.model.tendons.count
        if displacement is not None and tension is not None:
            raise ValueError("displacement and tension are both given; only one of them is allowed")
        if tension is not None:
            tension = _vector("tension", tension, count)
            if (tension < 0).any():
                raise ValueError(f"tension is {tension.min():g} N; a cable cannot push: allowed are 0 and more")
            return gravity, CableInput(tension=tension)
        if displacement is not None:
            return gravity, CableInput(wound=_vector("displacement", displacement, count, allow_nan=True))
        return gravity, CableInput()

    def _remember(self, u: np.ndarray, h: float | None) -> None:
        """Let the body creep to the equilibrium u (n, 3) in h s; None: it is relaxed there."""
        if not self._creep.exists:
            return
        if h is None:
            self._creep.relax(u)
        else:
            self._creep.advance(u, h)

    def _shape(self, state: Equilibrium, gravity: np.ndarray, started: float) -> Shape:
        """Return the shape and response of a state of the full model; started: of the computation, by `time.perf_counter`."""
        sections, orientation, _, displacement, response = observed(self.model, state)
        return Shape(
            tip_position=sections[-1, 0],
            tip_orientation=orientation[-1],
            backbone_station=self.model.effectors.station,
            backbone_position=sections[:-1, 0],
            backbone_orientation=orientation[:-1],
            cable_displacement=displacement,
            cable_tension=state.tension,
            gravity=gravity,
            response=response,
            residual=state.residual,
            solve_time=time.perf_counter() - started,
            status=ShapeStatus.OK if state.converged else ShapeStatus.NOT_CONVERGED,
            message=beyond_range(self.model, state.u) if state.converged else self._reason(state, gravity),
            contacts=Contacts.none() if self.solver.contact is None else self.solver.contact.contacts(state),
        )

    def _reason(self, state: Equilibrium, gravity: np.ndarray) -> str:
        """Return the reason why no equilibrium was found under gravity (3,), as a sentence."""
        if state.load_fraction == 1.0:  # no search was made
            return "no equilibrium was found near the last shape, which is kept"
        message = f"no equilibrium was found beyond {100 * state.load_fraction:.2g} % of the load"
        narrow = "" if self.solver.contact is None else self.solver.contact.squeezed(state.u, gravity)
        return f"{message}: {narrow or beyond_range(self.model, state.u) or _LIMIT_POINT}"


def _vector(name: str, value: np.ndarray, length: int, allow_nan: bool = False) -> np.ndarray:
    """Return the value as an array (length,). Raises ValueError."""
    vector = np.asarray(value, dtype=float)
    if vector.shape != (length,):
        raise ValueError(f"{name} has the shape {vector.shape}; ({length},) is needed")
    finite = math.isfinite(vector @ vector)  # usually makes the slower checks unnecessary
    if not finite and (np.isinf(vector).any() or (not allow_nan and np.isnan(vector).any())):
        raise ValueError(f"{name} is {vector}; finite numbers are needed")
    return vector
