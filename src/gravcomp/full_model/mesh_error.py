"""Measured error of a mesh: the distance of the tip from that of a mesh that is twice as fine along, around and through the wall.

The elements of a body from a file are divided into eight, half as large each way, on the same surface.

This is the check of `mesh_choice`, which only estimates the error; it takes minutes. The shape on the finer mesh is found from
that on the described one; where that step is too long, by way of meshes that are finer in one direction after the other.
"""

import contextlib
import dataclasses
from collections.abc import Callable, Iterator

import numpy as np

from gravcomp.description import Elements, Robot
from gravcomp.full_model.mesh_loads import (
    ITERATIONS,
    MOST_STEPS,
    TIMES,
    LoadedShapes,
    MeshLoad,
    less_tension,
    mesh_loads,
    shapes_under,
)
from gravcomp.full_model.model import MeshedModel
from gravcomp.full_model.recovered_strain import can_be_estimated
from gravcomp.full_model.robot_model import RobotModel
from gravcomp.mesh import MeshError
from gravcomp.mesh.refinement import refined

# The most multiplications of one factor of the finer mesh, about five seconds of one core, and of all factors with which a load
# is followed from the straight robot on one mesh, about a minute.
_MOST_WORK, _MOST_TO_FOLLOW = 2e11, 2e12

Progress = Callable[[str], None]


def error_of_mesh(robot: Robot, progress: Progress = lambda stage: None) -> float:
    """Return the largest distance of the tips over the robot's length, over the loads of `mesh_loads`.

    progress: called with the load and the mesh that are computed. Raises MeshError where one of the meshes finds no equilibrium,
    and where the finer mesh is too large to be solved in a few minutes.
    """
    model = RobotModel(robot)
    finer = _twice_as_fine(model)
    work = _work(finer)
    if work > _MOST_WORK:
        estimate = "; `model info` prints an estimate" if can_be_estimated(model) else ""
        raise MeshError(
            f"the mesh twice as fine has {finer.pattern.n} unknowns in {len(finer.pattern.size)} levels: a step takes"
            f" {work / _MOST_WORK:.1f} times as long as allowed, and the error is not measured{estimate}"
        )
    return max(_distance(model, finer, load, progress) for load in mesh_loads(model)) / robot.length


def _distance(model: RobotModel, finer: MeshedModel, load: MeshLoad, progress: Progress) -> float:
    """Return the distance (m) of the tips of both meshes under a load, with less tension where that has no equilibrium.

    Raises MeshError where there is none.
    """
    for _ in range(TIMES):
        progress(f"load '{load.name}', {model.pattern.n} unknowns")
        coarse = shapes_under(model, [load])
        what, there = "described", coarse
        if _found(coarse):
            what, there = "finer", _shape_on(finer, model, load, coarse, progress)
            if _found(there):
                return float(np.linalg.norm(coarse.tips - there.tips))
        if not load.tension.any():
            break
        (load,) = less_tension([load])
    raise MeshError(f"the {what} mesh finds no equilibrium under the load '{load.name}'")


def _shape_on(finer: MeshedModel, model: RobotModel, load: MeshLoad, coarse: LoadedShapes, progress: Progress) -> LoadedShapes:
    """Return the shape on the finer mesh under the load, from that of `model`, its tip NaN where none is found."""
    progress(f"load '{load.name}', {finer.pattern.n} unknowns")
    there = shapes_under(finer, [load], near=coarse, steps=0)
    if _found(there):
        return there
    near = coarse
    for between in _between(model):
        progress(f"load '{load.name}', {between.pattern.n} unknowns, on the way to {finer.pattern.n}")
        near = shapes_under(between, [load], near=near, steps=_steps(between))
    return shapes_under(finer, [load], near=near, steps=_steps(finer))


def _found(shapes: LoadedShapes) -> bool:
    return not np.isnan(shapes.tips).any()


def _steps(model: MeshedModel) -> int:
    """Return in how many steps a load may be followed on a mesh."""
    return min(MOST_STEPS, int(_MOST_TO_FOLLOW / (ITERATIONS * _work(model))))


def _work(model: MeshedModel) -> float:
    """Return about how many multiplications a factor of the model's tangent takes."""
    return float((model.pattern.size.astype(float) ** 3).sum())


def _between(model: RobotModel) -> Iterator[MeshedModel]:
    """Yield the model on meshes on the way to one twice as fine each way, as far as they can be made; none for a file's."""
    elements = model.robot.elements
    if elements is None:
        return
    for one in (_twice_along(elements), dataclasses.replace(_twice_along(elements), around=2 * elements.around)):
        with contextlib.suppress(MeshError):
            yield MeshedModel(dataclasses.replace(model.robot, elements=one))


def _twice_as_fine(model: RobotModel) -> RobotModel:
    """Return the model on a mesh that is twice as fine each way. Raises MeshError."""
    elements = model.robot.elements
    if elements is not None:
        twice = dataclasses.replace(_twice_along(elements), around=2 * elements.around, radial=2 * elements.radial)
        return RobotModel(dataclasses.replace(model.robot, elements=twice))
    return RobotModel(model.robot, refined(model.mesh))


def _twice_along(elements: Elements) -> Elements:
    """Return the elements with twice as many along the robot."""
    first = elements.first_layer and elements.first_layer / 2
    return dataclasses.replace(elements, along=2 * elements.along, first_layer=first)
