"""Bodies that numbers of elements divide: rows of segments, and bodies from a file whose section is swept along their axis."""

import dataclasses
from collections.abc import Sequence

from gravcomp.description import Elements, Robot
from gravcomp.mesh.layers import LayeredPiece, least_layers
from gravcomp.mesh.levels import Curve
from gravcomp.mesh.mesh import Mesh, MeshError
from gravcomp.mesh.swept import swept_mesh
from gravcomp.mesh.swept_sections import swept_sections
from gravcomp.mesh.tube import coarse_elements, tube_mesh


def divided_mesh(robot: Robot, elements: Elements) -> Mesh:
    """Return the mesh of the robot with these numbers of elements. Raises MeshError where they cannot be met."""
    if robot.body is None:
        return tube_mesh(robot if robot.elements == elements else dataclasses.replace(robot, elements=elements))
    return swept_mesh(robot.body, elements)


def pieces_to_divide(robot: Robot) -> Sequence[LayeredPiece]:
    """Return the pieces along the robot. Raises MeshError for a body from a file that cannot be swept."""
    return robot.pieces if robot.body is None else [swept_sections(robot.body)]


def why_not_swept(robot: Robot) -> str | None:
    """Return why the body of a robot's file cannot be swept; None where it can."""
    try:
        pieces_to_divide(robot)
    except MeshError as error:
        return str(error)
    return None


def fewest_elements(robot: Robot) -> Elements:
    """Return numbers of elements with which a look at the robot is quick. Raises MeshError."""
    if robot.body is None:
        return coarse_elements(robot)
    sections = swept_sections(robot.body)
    return Elements(around=8 if sections.in_quarters else 6, along=max(10, least_layers([sections])))


def walls(robot: Robot) -> list[tuple[float, list[float]]]:
    """Return half of the smaller width (m) of the section at the base of each segment, and those of its lumens."""
    if robot.body is not None:
        *lumens, outline = swept_sections(robot.body).curves(0.0)
        return [(_half(outline), [_half(lumen) for lumen in lumens])]
    return [(_half(segment.outline(0.0)), [_half(lumen) for lumen in segment.lumen_outlines(0.0)]) for segment in robot.segments]


def _half(curve: Curve) -> float:
    return min(curve.half_width, curve.half_height)
