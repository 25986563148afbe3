"""Elements of a robot whose file gives none."""

import dataclasses

from gravcomp.description import Robot
from gravcomp.mesh.refusal import well_shaped
from gravcomp.mesh.tube import coarse_elements


def with_elements(robot: Robot) -> Robot:
    """Return the robot with well-shaped elements, where it consists of segments and its file gives none.

    They cost nothing to find, but their error is not known: `full_model.mesh_choice` finds those that reach an accuracy.
    """
    if robot.body is not None or robot.elements is not None:
        return robot
    coarse = coarse_elements(robot)
    return dataclasses.replace(robot, elements=well_shaped(robot, coarse) or coarse)
