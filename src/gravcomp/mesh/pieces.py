"""The parts of which a row of segments consists: every segment and every cap, with the sections at both of its ends."""

import dataclasses

from gravcomp.description import Material, Outline, Robot
from gravcomp.mesh.mesh import MeshError
from gravcomp.rest_axis import Arc, RestAxis


@dataclasses.dataclass(frozen=True)
class Piece:
    """A part of one material, whose section changes linearly.

    length (m); outer and inner: outlines at its base and its tip, `inner` None where it is solid; marks: arc lengths (m)
    from its base, its ends not among them, where layers of elements must end.
    """

    name: str
    length: float
    outer: tuple[Outline, Outline]
    inner: tuple[Outline, Outline] | None
    material: Material
    marks: tuple[float, ...] = ()


def pieces_of(robot: Robot) -> list[Piece]:
    """Return the pieces from base to tip. Raises MeshError for segments with more than one lumen."""
    pieces = []
    for segment in robot.segments:
        outer = segment.outline(0.0), segment.outline(1.0)
        lumens = segment.lumen_outlines(0.0), segment.lumen_outlines(1.0)
        if len(lumens[0]) > 1:
            raise MeshError(
                f"segment '{segment.name}' has {len(lumens[0])} lumens; segments are meshed with one lumen at most:"
                " give a body with several as a mesh file (robot.body)"
            )
        inner = (lumens[0][0], lumens[1][0]) if lumens[0] else None
        marks = tuple(segment.disks.heights(segment.length)[:-1]) if segment.disks else ()
        pieces.append(Piece(segment.name, segment.length, outer, inner, segment.material, marks))
        if segment.cap:
            ends = (outer[1], outer[1]), (inner[1], inner[1]) if inner else None
            pieces.append(Piece(f"{segment.name}, cap", segment.cap.length, *ends, segment.cap.material))
    return pieces


def rest_axis(robot: Robot) -> RestAxis:
    """Return the axis at rest, one arc for every segment and cap."""
    arcs = []
    for segment in robot.segments:
        rest = segment.rest
        arcs.append(Arc(segment.length, rest.bend_angle, rest.bend_plane) if rest else Arc(segment.length))
        if segment.cap:
            arcs.append(Arc(segment.cap.length))
    axis = RestAxis(tuple(arcs))
    return axis if axis.bent else RestAxis()
