"""Models of robots that differ in stiffness and viscosity alone, as those of a fit: they share mesh, cables and weights."""

import copy
import dataclasses

from gravcomp.description import Robot
from gravcomp.full_model.chosen_elements import with_chosen_elements
from gravcomp.full_model.robot_model import RobotModel

_VISCOUS = ("damping_time", "creep_ratio", "creep_time", "prony")
_last: list[tuple[dict, RobotModel]] = []  # the last geometry and its model


def model_of(robot: Robot) -> RobotModel:
    """Return the model of a robot, on the mesh of the last one where their geometries are the same. Raises MeshError.

    A body from a file has its own each time, because its file may change.
    """
    if robot.body is not None:
        return RobotModel(robot)
    robot = with_chosen_elements(robot)
    geometry = _geometry(robot)
    if not _last or _last[0][0] != geometry:
        _last[:] = [(geometry, RobotModel(robot))]
    model = copy.copy(_last[0][1])
    model.robot, model.mesh = robot, dataclasses.replace(model.mesh, materials=tuple(piece.material for piece in robot.pieces))
    model.elements = model.elements.with_materials(model.mesh)
    return model


def _geometry(robot: Robot) -> dict:
    """Return what decides on mesh, cables and weights: all but viscosity, and moduli only relative to the first."""
    described = dataclasses.asdict(robot)
    for segment in described["segments"]:
        for part in filter(None, (segment, segment["cap"])):
            material = part["material"]
            material["youngs_modulus"] /= robot.materials[0].youngs_modulus
            for name in _VISCOUS:
                del material[name]
    return described
