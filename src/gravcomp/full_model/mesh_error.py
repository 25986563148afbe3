"""Measured error of a mesh: the distance of the tip from that of a mesh that is twice as fine along, around and through the wall.

This is the check of `mesh_choice`, which only estimates the error; it takes minutes.
"""

import dataclasses

import numpy as np

from gravcomp.description import Robot
from gravcomp.full_model.mesh_loads import mesh_loads, shapes_under
from gravcomp.full_model.robot_model import RobotModel
from gravcomp.mesh import MeshError


def error_of_mesh(robot: Robot) -> float:
    """Return the largest distance of the tips over the robot's length, over the loads of `mesh_loads`.

    Raises MeshError for a body from a file, and where one of the meshes finds no equilibrium.
    """
    model = RobotModel(robot)
    elements = model.robot.elements
    if elements is None:
        raise MeshError("the mesh is that of a file, and is not refined: compare with a finer file")
    twice = dataclasses.replace(elements, around=2 * elements.around, along=2 * elements.along, radial=2 * elements.radial)
    loads = mesh_loads(model)
    coarse = shapes_under(model, loads)
    fine = shapes_under(RobotModel(dataclasses.replace(robot, elements=twice)), loads, near=coarse)
    here, there = coarse.tips, fine.tips
    for load, one, two in zip(loads, here, there):
        for tip, what in ((one, "described"), (two, "finer")):
            if np.isnan(tip).any():
                raise MeshError(f"the {what} mesh finds no equilibrium under the load '{load.name}'")
    return float(np.linalg.norm(here - there, axis=1).max()) / robot.length
