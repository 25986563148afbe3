"""A robot with the mesh that is chosen for it where its file gives none.

Segments, and bodies from a file whose section can be swept along the axis, are divided into hexahedra (`mesh_choice`). Another
surface is filled with tetrahedra of a chosen size (`size_choice`). A file with elements of its own keeps them.
"""

import dataclasses

from gravcomp.description import Robot
from gravcomp.full_model import size_choice
from gravcomp.full_model.mesh_choice import chosen_mesh, place_of_choice
from gravcomp.mesh.division import why_not_swept


def with_chosen_elements(robot: Robot) -> Robot:
    """Return the robot with chosen elements, where its file gives none. Raises MeshError."""
    if _has_elements(robot):
        return robot
    if why_not_swept(robot) is None:
        return dataclasses.replace(robot, elements=chosen_mesh(robot).elements)
    return size_choice.with_chosen_size(robot)


def is_chosen(robot: Robot) -> bool:
    """Return whether `with_chosen_elements` has no choice to compute: the robot has a mesh, or its choice is in the cache.

    Raises MeshError.
    """
    if _has_elements(robot):
        return True
    return (place_of_choice(robot) if why_not_swept(robot) is None else size_choice.place_of_choice(robot)).exists()


def _has_elements(robot: Robot) -> bool:
    return robot.elements is not None or (robot.body is not None and robot.body.placed().kind != "tri3")
