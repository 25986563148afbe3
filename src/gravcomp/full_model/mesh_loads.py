"""The loads under which the error of a mesh is measured: the robot's own weight, and a cable that bends it up to its limits.

The bending load is a tension of one cable of the weightless robot. It ends where the first of these is reached: the limit of
the tension, the limit of the cable's displacement, a right angle between the tip and its direction at rest, or a part of the
last tension that has an equilibrium, as near a limit point a shape has no bounded error.
"""

import dataclasses
import logging

import numpy as np

from gravcomp.full_model.cable_input import CableInput
from gravcomp.full_model.carried_shape import carried_shape
from gravcomp.full_model.model import MeshedModel
from gravcomp.full_model.statics import StaticSolver
from gravcomp.mesh import MeshError

TIMES = 4
"""How often tensions that a finer mesh does not carry are made smaller."""

ITERATIONS, MOST_STEPS = 10, 40
"""Newton's iterations of a step of a load that is followed, and the most steps, with those that fail."""

_LESS = 0.7
_GRAVITY = 9.81
_TURN = np.pi / 2
# The part of the last tension with an equilibrium that is used, and the steps in which a load is searched for.
_SAFE = 0.7
# A load is followed in steps of its parts: the first one, the largest and the smallest.
_STEP, _LARGEST, _SMALLEST = 0.125, 0.25, 1.0 / 256.0
# The tension grows by this factor from step to step, from this part of its limit; by the small one where that is too much.
_FACTOR, _SMALL_FACTOR, _FIRST = 1.35, 1.08, 0.01


@dataclasses.dataclass(frozen=True)
class MeshLoad:
    """A load: name; gravity (3,) in m/s^2; tension (m,) in N."""

    name: str
    gravity: np.ndarray
    tension: np.ndarray


def mesh_loads(model: MeshedModel) -> list[MeshLoad]:
    """Return the loads of a robot: its weight across its axis, in two directions where it is not round, and the bend."""
    robot, none = model.robot, np.zeros(len(model.robot.cables))
    loads = [MeshLoad("horizontal", np.array([-_GRAVITY, 0.0, 0.0]), none)]
    if robot.body is not None or any(not segment.outline(0.0).round for segment in robot.segments):
        loads.append(MeshLoad("horizontal, turned by 90 degrees", np.array([0.0, -_GRAVITY, 0.0]), none))
    tension = _bending_tension(model)
    if tension is not None:
        loads.append(MeshLoad("bent", np.zeros(3), tension))
    return loads


def less_tension(loads: list[MeshLoad]) -> list[MeshLoad]:
    """Return the loads with smaller tensions: near a limit point a finer mesh has no equilibrium where a coarse one has."""
    return [dataclasses.replace(load, tension=_LESS * load.tension) for load in loads]


@dataclasses.dataclass(frozen=True)
class LoadedShapes:
    """The shapes of a model under loads: displacements (n, 3) in m of each, None where no equilibrium is found."""

    model: MeshedModel
    shapes: tuple[np.ndarray | None, ...]

    @property
    def tips(self) -> np.ndarray:
        """The tips (l, 3) in m; NaN where no equilibrium is found."""
        tips = np.full((len(self.shapes), 3), np.nan)
        for index, u in enumerate(self.shapes):
            if u is not None:
                tips[index] = self.model.effectors.sections(self.model.mesh.nodes + u)[-1, 0]
        return tips


def shapes_under(
    model: MeshedModel, loads: list[MeshLoad], near: LoadedShapes | None = None, steps: int = MOST_STEPS
) -> LoadedShapes:
    """Return the shapes under the loads.

    near: the shapes of another mesh of the same robot under the same loads. Newton's method starts from them; only where that
    fails, the load is followed from the straight robot. steps: the most of them in which a load is followed, each of up to
    `ITERATIONS` factors of the tangent.
    """
    solver = StaticSolver(model)
    shapes: list[np.ndarray | None] = []
    for index, load in enumerate(loads):
        solver.reset()
        known = near.shapes[index] if near else None
        found = near is not None and known is not None and _from_near(solver, load, near.model, known)
        shapes.append(solver.state.u if found or _follow(solver, load, steps) else None)
    return LoadedShapes(model, tuple(shapes))


def _from_near(solver: StaticSolver, load: MeshLoad, source: MeshedModel, shape: np.ndarray) -> bool:
    """Search for the equilibrium near the shape (n, 3) of another mesh; returns whether there is one."""
    model = solver.model
    in_layers = source.mesh.in_layers
    for by_elements in (False, True) if in_layers else (True,):
        try:
            u = carried_shape(shape, source.mesh, model.mesh, by_elements=by_elements)
        except MeshError:
            if not in_layers:
                raise
            return False
        solver.state = dataclasses.replace(
            solver.state, u=u, tension=load.tension.copy(), tendons=model.tendons.state(model.mesh.nodes + u)
        )
        if solver.track(load.gravity, CableInput(tension=load.tension), ITERATIONS).converged:
            return True
        solver.reset()
    return False


def _follow(solver: StaticSolver, load: MeshLoad, steps: int = MOST_STEPS) -> bool:
    """Follow the equilibrium of the straight robot up to the load; returns whether there is one within the steps allowed."""
    done, step = 0.0, _STEP
    smallest = _SMALLEST * solver.share_of_steps(load.gravity)
    for _ in range(steps):
        before, part = solver.state, min(1.0, done + step)
        if solver.track(part * load.gravity, CableInput(tension=part * load.tension), ITERATIONS).converged:
            done, step = part, min(1.5 * step, _LARGEST)
            if done >= 1.0:
                return True
            continue
        solver.state, step = before, step / 2.0
        if step < smallest:
            break
    return False


def _bending_tension(model: MeshedModel) -> np.ndarray | None:
    """Tensions (m,) that bend the robot by the cable that ends last; None where there is no cable or it does not move."""
    robot = model.robot
    if not robot.cables:
        return None
    index = int(np.argmax([robot.cable_end(cable) for cable in robot.cables]))
    unit, solver = np.eye(len(robot.cables))[index], StaticSolver(model)
    limit, factor = robot.limits.tension_max, _FACTOR
    tension, best, best_angle = _FIRST * limit, 0.0, 0.0
    while True:
        before = solver.state
        state = solver.track(np.zeros(3), CableInput(tension=tension * unit), ITERATIONS)
        if not state.converged:
            if factor == _SMALL_FACTOR:
                logging.getLogger(__name__).info("no equilibrium at a tension of %.3g N", tension)
                best *= _SAFE
                break
            solver.state, factor = before, _SMALL_FACTOR
            tension = factor * best if best else 0.1 * tension
            continue
        if state.tendons.displacement[index] > robot.limits.displacement_max:
            break
        angle = _turned(model, state.u)
        if angle > _TURN:  # a step of the tension may go far beyond
            best += (tension - best) * (_TURN - best_angle) / (angle - best_angle)
            break
        best, best_angle = tension, angle
        if tension >= limit:
            break
        tension = min(limit, factor * tension)
    return best * unit if best else None


def _turned(model: MeshedModel, u: np.ndarray) -> float:
    """Angle (rad) between the directions of the tip at displacements u (n, 3) and at rest."""
    (_, one, two), (_, rest_one, rest_two) = (
        model.effectors.sections(nodes)[-1] for nodes in (model.mesh.nodes + u, model.mesh.nodes)
    )
    d, rest = np.cross(one, two), np.cross(rest_one, rest_two)
    return float(np.arccos(np.clip(d @ rest / np.linalg.norm(d) / np.linalg.norm(rest), -1.0, 1.0)))
