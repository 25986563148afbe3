"""The division of segments into elements that reaches an accuracy.

The tip is computed under the robot's own weight, horizontally, and bent by a cable. A coarse mesh is refined in one direction
after the other (along, around, radially) until the remaining error of that direction is within its share of `ACCURACY`: the
changes of the tip form a geometric series, whose rest is known after two of them, and which says how far to refine.

The choice is kept in the cache, by content. Young's moduli enter rounded down to a power of two, so that a calibrated robot
has the mesh of the robot from which it was calibrated.
"""

import dataclasses
import json
import logging
import math
from typing import TYPE_CHECKING

import numpy as np

from gravcomp.cache import cache_path, content_key
from gravcomp.description import Elements, Material, Robot
from gravcomp.mesh.mesh import MeshError
from gravcomp.mesh.pieces import pieces_of
from gravcomp.mesh.refusal import well_shaped
from gravcomp.mesh.tube import coarse_elements

if TYPE_CHECKING:
    from gravcomp.full_model.model import RobotModel
    from gravcomp.full_model.statics import StaticSolver

ACCURACY = 1e-3
_FORMAT = 1  # part of the key; to be raised when the choice changes
_GRAVITY = 9.81
# Directions in the order in which they are refined, with their share of the error and the ratio of two refinements.
_SHARES = {"along": 0.5, "around": 0.3, "radial": 0.2}
_REFINEMENTS = 10
_MOST_UNKNOWNS = 20000
# The ratio of two changes where it is not known yet.
_RATIO = 0.4
# The part of the last tension with an equilibrium that is used, and the parts in which a load is searched for.
_SAFE, _PARTS = 0.7, 4
# The bent robot's tip is turned by up to this angle (rad).
_BENT = 1.6


def chosen_elements(robot: Robot) -> Elements:
    """Return the chosen division. Raises MeshError for a robot that cannot be meshed."""
    rounded = _rounded(robot)
    path = cache_path("mesh", content_key(_FORMAT, rounded), ".json")
    if path.exists():
        return Elements(**json.loads(path.read_text()))
    elements = _choose(rounded)
    part = path.with_suffix(".part")
    part.write_text(json.dumps(dataclasses.asdict(elements)))
    part.replace(path)
    return elements


def _rounded(robot: Robot) -> Robot:
    """The robot with what does not matter for the mesh removed, and Young's moduli rounded."""

    def material(m: Material) -> Material:
        return dataclasses.replace(
            m,
            youngs_modulus=2.0 ** math.floor(math.log2(m.youngs_modulus)),
            damping_time=0.0,
            creep_ratio=0.0,
            creep_time=0.5,
            prony=(),
        )

    segments = tuple(
        dataclasses.replace(
            s, material=material(s.material), cap=s.cap and dataclasses.replace(s.cap, material=material(s.cap.material))
        )
        for s in robot.segments
    )
    cables = tuple(dataclasses.replace(c, axial_stiffness=None, friction=0.0) for c in robot.cables)
    return Robot("chosen", segments=segments, cables=cables, limits=robot.limits, payload=robot.payload)


def _choose(robot: Robot) -> Elements:
    elements = _start(robot)
    solver, model = _solver(robot, elements)
    tension = _bending_tension(robot, solver, model)
    here, total = _tips(solver, model, tension), 0.0
    for direction, share in _SHARES.items():
        elements, here, rest = _refined(robot, elements, direction, share * ACCURACY * robot.length, tension, here)
        total += rest
    if total > ACCURACY * robot.length:
        logging.getLogger(__name__).warning(
            "the mesh chosen leaves an error of about %.2g mm at the tip; allowed: %.2g mm",
            1e3 * total,
            1e3 * ACCURACY * robot.length,
        )
    return elements


def _refined(
    robot: Robot, elements: Elements, direction: str, allowed: float, tension: np.ndarray | None, here: list[np.ndarray | None]
) -> tuple[Elements, list[np.ndarray | None], float]:
    """Refine in one direction until the rest of its error is at most `allowed` (m): the numbers, the tips there, and the rest."""
    last, rest = None, np.inf
    for _ in range(_REFINEMENTS):
        finer = _finer(robot, elements, direction)
        if finer == elements or _unknowns(robot, finer) > _MOST_UNKNOWNS:
            break
        there = _tips(*_solver(robot, finer), tension)
        if any(a is not None and b is None for a, b in zip(here, there)):
            logging.getLogger(__name__).warning(
                "with a finer mesh the robot loses its equilibrium under a load of the mesh's choice:"
                " the material is compressed beyond what its"
                " law carries (svk softens in strong compression, neo_hookean does not)"
            )
            return elements, here, 0.0 if last is None else rest
        change = _change(here, there)
        ratio = min(max(change / last, 0.2), 0.7) if last else _RATIO
        rest = change / (1.0 - ratio)
        if rest <= allowed:
            break
        elements, here, last, rest = finer, there, change, change * ratio / (1.0 - ratio)
        if rest <= allowed:
            break
    return elements, here, rest


def _start(robot: Robot) -> Elements:
    """Coarse numbers whose elements are well shaped."""
    pieces = pieces_of(robot)
    parts = sum(len(piece.marks) + 1 for piece in pieces)
    disks = any(piece.marks for piece in pieces)
    coarse = coarse_elements(robot)
    around = 4 if coarse.around == 8 else 6
    along = parts if disks else max(6, parts)
    # Between disks the layers are even; else they are graded towards the clamp, whose corner is singular.
    start = Elements(around=around, along=along, radial=1, grading=1.0 if disks else 8.0, equal_stiffness=True)
    shaped = well_shaped(robot, start)
    if shaped is None:
        raise MeshError(
            f"robot '{robot.name}': no mesh of its segments has elements of a good shape; its walls are too thin or too steep"
        )
    return shaped


def _finer(robot: Robot, elements: Elements, direction: str) -> Elements:
    """The next numbers in a direction."""
    if direction == "around":
        return dataclasses.replace(elements, around=min(elements.around + (4 if elements.around % 4 == 0 else 2), 48))
    if direction == "radial":
        return dataclasses.replace(elements, radial=min(elements.radial + 1, 8))
    parts = sum(len(piece.marks) + 1 for piece in pieces_of(robot))
    disks = any(segment.disks for segment in robot.segments)
    along = elements.along + parts if disks else math.ceil(1.5 * elements.along)
    return dataclasses.replace(elements, along=min(along, 500))


def _solver(robot: Robot, elements: Elements) -> "tuple[StaticSolver, RobotModel]":
    from gravcomp.full_model.model import RobotModel
    from gravcomp.full_model.statics import StaticSolver

    model = RobotModel(dataclasses.replace(robot, elements=elements))
    return StaticSolver(model), model


def _bending_tension(robot: Robot, solver: "StaticSolver", model: "RobotModel") -> np.ndarray | None:
    """Tensions (m,) that bend the weightless robot by its last cable up to the limits; None where it cannot."""
    from gravcomp.full_model.cable_input import CableInput

    if not robot.cables:
        return None
    unit, best = np.eye(len(robot.cables))[-1], None
    # Along a geometric series, as the robot's softness is not known.
    for tension in robot.limits.tension_max * 2.0 ** np.arange(-10.0, 0.5, 0.5):
        state = solver.track(np.zeros(3), CableInput(tension=tension * unit), iterations=15, exact=True)
        if not state.converged:  # a finer mesh may lose the equilibrium a little earlier
            best = None if best is None else _SAFE * best
            break
        if state.tendons.displacement[-1] > robot.limits.displacement_max:
            break
        best = tension * unit
        if _turned(solver, model) > _BENT:
            break
    solver.reset()
    return best


def _turned(solver: "StaticSolver", model: "RobotModel") -> float:
    _, one, two = model.effectors.sections(model.mesh.nodes + solver.state.u)[-1]
    _, rest_one, rest_two = model.effectors.sections(model.mesh.nodes)[-1]
    d, rest = np.cross(one, two), np.cross(rest_one, rest_two)
    return float(np.arccos(np.clip(d @ rest / np.linalg.norm(d) / np.linalg.norm(rest), -1.0, 1.0)))


def _tips(solver: "StaticSolver", model: "RobotModel", tension: np.ndarray | None) -> list[np.ndarray | None]:
    """The tip (3,) under each load; None where there is no equilibrium."""
    from gravcomp.full_model.cable_input import CableInput

    loads = [(np.array([-_GRAVITY, 0.0, 0.0]), CableInput())]
    if any(not segment.outline(0.0).round for segment in model.robot.segments):
        loads.append((np.array([0.0, -_GRAVITY, 0.0]), CableInput()))
    if tension is not None:
        loads.append((np.zeros(3), CableInput(tension=tension)))
    result: list[np.ndarray | None] = []
    for gravity, cables in loads:
        solver.reset()
        state = solver.solve(gravity, cables, _PARTS)
        section = model.effectors.sections(model.mesh.nodes + state.u)[-1]
        result.append(section[0] if state.converged else None)
    return result


def _change(here: list, there: list) -> float:
    """The largest distance (m) between the tips under the loads that both meshes carry."""
    pairs = [np.linalg.norm(a - b) for a, b in zip(here, there) if a is not None and b is not None]
    return float(max(pairs, default=0.0))


def _unknowns(robot: Robot, elements: Elements) -> int:
    from gravcomp.mesh.tube import tube_mesh

    return 3 * len(tube_mesh(dataclasses.replace(robot, elements=elements)).nodes)
