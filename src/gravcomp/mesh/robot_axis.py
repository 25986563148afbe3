"""The axis of a robot at rest, from its segments or from the file of its body."""

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
