"""The axis of a robot at rest, from its segments or from the file of its body."""

import numpy as np

from gravcomp.description import Robot
from gravcomp.rest_axis import Arc, RestAxis


def rest_axis(robot: Robot) -> RestAxis:
    """Return the axis at rest, one arc for every segment and cap; that of a body from a file is read. Raises MeshError."""
    if robot.body is not None:
        return robot.body.placed().axis
    arcs = []
    for segment in robot.segments:
        rest = segment.rest
        arcs.append(Arc(segment.length, rest.bend_angle, rest.bend_plane) if rest else Arc(segment.length))
        if segment.cap:
            arcs.append(Arc(segment.cap.length))
    axis = RestAxis(tuple(arcs))
    return axis if axis.bent else RestAxis()


def rest_tip(robot: Robot) -> tuple[np.ndarray, np.ndarray]:
    """Return position (3,) in m and direction (3,) of the tip at rest. Raises MeshError."""
    position, rotation = rest_axis(robot).frames(np.array([robot.length]))
    return position[0], rotation[0, :, 2]
