"""Measured error of a mesh: the distance of the tip from that of a mesh that is twice as fine along, around and through the wall.

The elements of a body from a file are divided into eight, half as large each way, on the same surface.

This is the check of `mesh_choice`, which only estimates the error; it takes minutes.
"""

import dataclasses

import numpy as np

from gravcomp.description import Robot
from gravcomp.full_model.mesh_loads import TIMES, less_tension, mesh_loads, shapes_under
from gravcomp.full_model.robot_model import RobotModel
from gravcomp.mesh import MeshError
from gravcomp.mesh.refinement import refined

# The most multiplications of one factor of the finer mesh, about five seconds of one core: a load takes some ten to a hundred.
_MOST_WORK = 2e11


def error_of_mesh(robot: Robot) -> float:
    """Return the largest distance of the tips over the robot's length, over the loads of `mesh_loads`.

    Raises MeshError where one of the meshes finds no equilibrium, and where the finer mesh is too large to be solved in a few
    minutes.
    """
    model = RobotModel(robot)
    finer = _twice_as_fine(model)
    work = float((finer.pattern.size.astype(float) ** 3).sum())
    if work > _MOST_WORK:
        raise MeshError(
            f"the mesh twice as fine has {finer.pattern.n} unknowns in {len(finer.pattern.size)} levels: a step takes"
            f" {work / _MOST_WORK:.1f} times as long as allowed, and the error is not measured; `model info` prints an estimate"
        )
    loads = mesh_loads(model)
    for _ in range(TIMES):
        coarse = shapes_under(model, loads)
        here, there = coarse.tips, shapes_under(finer, loads, near=coarse).tips
        if not np.isnan(there).any():
            break
        loads = less_tension(loads)
    for load, one, two in zip(loads, here, there):
        for tip, what in ((one, "described"), (two, "finer")):
            if np.isnan(tip).any():
                raise MeshError(f"the {what} mesh finds no equilibrium under the load '{load.name}'")
    return float(np.linalg.norm(here - there, axis=1).max()) / robot.length


def _twice_as_fine(model: RobotModel) -> RobotModel:
    """Return the model on a mesh that is twice as fine each way. Raises MeshError."""
    elements = model.robot.elements
    if elements is not None:
        twice = dataclasses.replace(
            elements,
            around=2 * elements.around,
            along=2 * elements.along,
            radial=2 * elements.radial,
            first_layer=elements.first_layer and elements.first_layer / 2,
        )
        return RobotModel(dataclasses.replace(model.robot, elements=twice))
    return RobotModel(model.robot, refined(model.mesh))
