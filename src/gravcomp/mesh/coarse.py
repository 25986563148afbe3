"""A mesh for quick looks at a robot: few elements, but none that is too distorted."""

import dataclasses

from gravcomp.description import Robot
from gravcomp.mesh.refusal import well_shaped
from gravcomp.mesh.tube import coarse_elements


def with_coarse_elements(robot: Robot) -> Robot:
    """Return the robot with a mesh for quick looks, a body from a file unchanged.

    A narrow lumen in a thick wall takes more elements than the fewest.
    """
    if robot.body is not None:
        return robot
    fewest = coarse_elements(robot)
    return dataclasses.replace(robot, elements=well_shaped(robot, fewest) or fewest)
