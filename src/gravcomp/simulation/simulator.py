"""A robot's statics as one object: gravity and cables in, shape and response out."""

import dataclasses
import math
import time
from typing import TYPE_CHECKING

import numpy as np

from gravcomp.description import Robot
from gravcomp.full_model.cable_input import CableInput
from gravcomp.full_model.equilibrium import Equilibrium
from gravcomp.full_model.model import RobotModel
from gravcomp.full_model.observation import observe
from gravcomp.full_model.shape import Response, Shape, ShapeStatus
from gravcomp.full_model.statics import StaticSolver
from gravcomp.mechanics.total_lagrangian import SolidElements
from gravcomp.simulation.search_pace import SearchPace

if TYPE_CHECKING:
    from gravcomp.reduction.reduced_model import ReducedModel
    from gravcomp.reduction.serving import ReducedServing

# Green's strain in compression from which on St. Venant-Kirchhoff's stress falls.
_SOFTENING = -1.0 / 3.0
_MORE_ITERATIONS = 12


class Simulator:
    """Quasi-static simulation of a robot. `step` uses the reduced model where one is built and holds; `solve` the full one."""

    def __init__(self, robot: Robot | RobotModel, reduced: bool = True):
        """`reduced`: use the reduced model where one is built. Raises MeshError for a body that cannot be computed with."""
        self.model = robot if isinstance(robot, RobotModel) else RobotModel(robot)
        self.robot = self.model.robot
        self.solver = StaticSolver(self.model)
        self._pace = SearchPace(self.model.length)
        self._serving = self.load_reduced() if reduced else None

    def load_reduced(self) -> "ReducedServing | None":
        """Return the reduced model of this robot, ready to serve; None when none is stored. May run in a thread of its own."""
        from gravcomp.reduction.serving import ReducedServing
        from gravcomp.reduction.store import load

        reduction = load(self.model)
        return reduction and ReducedServing(self.model, reduction.reduced_model(self.model), self.solver)

    def adopt(self, serving: "ReducedServing") -> None:
        """Serve by `serving`, from `load_reduced`, as soon as it agrees with the full model's shape: the shape does not jump."""
        serving.stand_by()
        self._serving = serving

    @property
    def reduced_model(self) -> "ReducedModel | None":
        """The reduced model that serves now; None while the full one does."""
        return self._serving.reduced if self._serving and self._serving.trusted else None

    @property
    def displacements(self) -> np.ndarray:
        """(nodes, 3) displacements of the mesh's nodes at the present shape, in m."""
        if self._serving and self._serving.trusted:
            return self._serving.displacements
        return self.solver.state.u

    def reset(self) -> None:
        """Back to the straight robot."""
        self.solver.reset()
        self._pace.reset()
        if self._serving:
            self._serving.reset()

    def step(self, gravity: np.ndarray, displacement: np.ndarray | None = None, tension: np.ndarray | None = None) -> Shape:
        """Follow the equilibrium, starting from the last shape: for small changes, a control step apart. Where it is lost it is
        searched for from the straight robot, now and then (see `SearchPace`): else the last shape is returned, NOT_CONVERGED.

        gravity (3,) in m/s^2; displacement (m,) in m, pulled in is positive, NaN for a released cable; or tension (m,) in
        N; neither: all cables released. Raises ValueError for wrong lengths and numbers that are not finite.
        """
        started = time.perf_counter()
        gravity, cables = self.checked(gravity, displacement, tension)
        shape = self._serving.step(gravity, cables) if self._serving else None
        if shape is not None:
            self._pace.found(gravity, cables)
            return shape
        before = self.solver.state
        state = self.solver.track(gravity, cables)
        if not state.converged:
            # More steps settle what is near; where the stiffness does not carry, nothing is.
            state = self.solver.track(gravity, cables, iterations=_MORE_ITERATIONS, stable=True)
        if not state.converged:
            if self._pace.may_search(gravity, cables):
                state = self.solver.solve(gravity, cables)
            else:
                state = dataclasses.replace(before, residual=state.residual, converged=False, load_fraction=1.0)
        if state.converged:
            self._pace.found(gravity, cables)
        else:
            self.solver.state = before
        shape = self._shape(state, gravity, started)
        if not self._serving:
            return shape
        reason = self._serving.reason
        self._serving.take_over(state, gravity, cables)
        if shape.status != ShapeStatus.OK:
            return shape
        return dataclasses.replace(shape, status=ShapeStatus.FALLBACK, message=f"{reason}: the full model serves")

    def solve(self, gravity: np.ndarray, displacement: np.ndarray | None = None, tension: np.ndarray | None = None) -> Shape:
        """The equilibrium from the straight robot, independent of what was computed before; arguments as in `step`."""
        started = time.perf_counter()
        gravity, cables = self.checked(gravity, displacement, tension)
        self.solver.reset()
        state = self.solver.solve(gravity, cables)
        self._pace.reset()
        if state.converged:
            self._pace.found(gravity, cables)
        if self._serving:
            self._serving.follow(state, gravity, cables)
        return self._shape(state, gravity, started)

    def checked(
        self, gravity: np.ndarray, displacement: np.ndarray | None, tension: np.ndarray | None
    ) -> tuple[np.ndarray, CableInput]:
        """Gravity and cable input as arrays; raises ValueError as `step` says."""
        gravity = _vector("gravity", gravity, 3)
        count = self.model.tendons.count
        if displacement is not None and tension is not None:
            raise ValueError("displacement and tension are both given; the cables are driven by one of them")
        if tension is not None:
            tension = _vector("tension", tension, count)
            if (tension < 0).any():
                raise ValueError(f"tension is {tension.min():g} N; a cable cannot push: allowed are 0 and more")
            return gravity, CableInput(tension=tension)
        if displacement is not None:
            return gravity, CableInput(wound=_vector("displacement", displacement, count, allow_nan=True))
        return gravity, CableInput()

    def _shape(self, state: Equilibrium, gravity: np.ndarray, started: float) -> Shape:
        model = self.model
        sections = model.effectors.sections(model.mesh.nodes + state.u)
        effector, compliance_ea, orientation = observe(sections, model.effectors.section_changes(state.answer))
        displacement = state.tendons.displacement + model.tendons.axial_compliance * state.tension
        response = Response(
            state.compliance,
            compliance_ea,
            displacement - state.compliance @ state.tension,
            effector - compliance_ea @ state.tension,
        )
        return Shape(
            tip_position=sections[-1, 0],
            tip_orientation=orientation[-1],
            backbone_station=model.effectors.station,
            backbone_position=sections[:-1, 0],
            backbone_orientation=orientation[:-1],
            cable_displacement=displacement,
            cable_tension=state.tension,
            gravity=gravity,
            response=response,
            residual=state.residual,
            solve_time=time.perf_counter() - started,
            status=ShapeStatus.OK if state.converged else ShapeStatus.NOT_CONVERGED,
            message="" if state.converged else self._why_not(state),
        )

    def _why_not(self, state: Equilibrium) -> str:
        """What a person should know about a load that found no equilibrium."""
        if state.load_fraction == 1.0:  # not searched for
            return "no equilibrium was found near the last shape, which is kept"
        message = f"no equilibrium was found beyond {100 * state.load_fraction:.0f} % of the load"
        softened = np.array([material.law == "svk" for material in self.model.mesh.materials])[self.model.mesh.region]
        if isinstance(self.model.elements, SolidElements) and softened.any():
            least = self.model.elements.strains(state.u)[softened, :, :3].min()
            if least < _SOFTENING:
                compressed = f"the body is compressed to {100 * np.sqrt(1 + 2 * least):.0f} % of its length at a point"
                return f"{message}: {compressed}, where the law 'svk' gives way; 'neo_hookean' carries more"
        return f"{message}: the robot cannot carry the rest, or has to jump to another shape"


def _vector(name: str, value: np.ndarray, length: int, allow_nan: bool = False) -> np.ndarray:
    vector = np.asarray(value, dtype=float)
    if vector.shape != (length,):
        raise ValueError(f"{name} has the shape {vector.shape}; ({length},) is needed")
    finite = math.isfinite(vector.sum())  # mostly spares the closer look
    if not finite and (np.isinf(vector).any() or (not allow_nan and np.isnan(vector).any())):
        raise ValueError(f"{name} is {vector}; finite numbers are needed")
    return vector
