"""A mesh for quick looks at a robot: few elements, but none that is too distorted."""

import dataclasses

from gravcomp.description import Elements, Robot
from gravcomp.mesh.refusal import well_shaped
from gravcomp.mesh.tube import coarse_elements


def with_coarse_elements(robot: Robot) -> Robot:
    """Return the robot with a mesh for quick looks; unchanged where its own has fewer cells, or its body is from a file.

    A narrow lumen in a thick wall takes more elements than the fewest.
    """
    if robot.body is not None:
        return robot
    fewest = coarse_elements(robot)
    coarse = well_shaped(robot, fewest) or fewest
    if robot.elements is not None and _cells(robot.elements) < _cells(coarse):
        return robot
    return dataclasses.replace(robot, elements=coarse)


def _cells(elements: Elements) -> int:
    return elements.around * elements.along * elements.radial
