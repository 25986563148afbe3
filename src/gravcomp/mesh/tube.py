"""Meshes of a row of segments, built from their dimensions: graded toward the clamp, whose corner is singular.

A division of the cross-section (`section_division`) is swept along the axis in layers (`layers`). Its cells become 20-node
hexahedra, or six tetrahedra each (Kuhn's division). The robot is meshed straight and then laid along its axis at rest.
"""

import numpy as np

from gravcomp.description import Elements, Robot
from gravcomp.mesh.layered_cells import halved, layered_cells
from gravcomp.mesh.layers import layers_of, least_layers
from gravcomp.mesh.mesh import Mesh
from gravcomp.mesh.robot_axis import rest_axis
from gravcomp.mesh.section_division import divided_sections


def tube_mesh(
    robot: Robot, kind: str = "hex20", around: int | None = None, along: int | None = None, radial: int | None = None
) -> Mesh:
    """Return the mesh of the robot's segments; the numbers of elements are the robot's unless given.

    kind: one of `elements.KINDS`. Raises MeshError when the numbers cannot be met.
    """
    elements = robot.elements or coarse_elements(robot)
    pieces = robot.pieces
    grid = divided_sections(pieces, around or elements.around, radial or elements.radial, elements.equal_stiffness)
    heights, piece_of_layer = layers_of(
        pieces, along or elements.along, elements.grading, elements.first_layer, elements.softness
    )

    levels = layered_cells(kind, grid.cells, [grid.present[piece] for piece in piece_of_layer])
    planar, level = levels.planar, levels.level

    # A section lies between the planes at both ends of its piece, and changes linearly from one to the other.
    ends = np.concatenate([[0.0], np.cumsum([piece.length for piece in pieces])])
    height = halved(heights)
    piece_of_level = np.repeat(piece_of_layer, 2)[np.minimum(np.arange(len(height)), len(height) - 2)]
    part = (height - ends[piece_of_level]) / np.diff(ends)[piece_of_level]
    base, part = piece_of_level[level], part[level][:, None]
    low_place, high_place = grid.place[base, planar], grid.place[base + 1, planar]
    # In the plane itself the other end may not be known: a wall may end there.
    place = np.where(part <= 0.0, low_place, np.where(part >= 1.0, high_place, (1.0 - part) * low_place + part * high_place))
    straight = np.column_stack([place, height[level]])
    region = np.array(piece_of_layer)[levels.layer]
    materials = tuple(piece.material for piece in pieces)
    axis = rest_axis(robot)
    return Mesh(
        kind, axis.points(straight), levels.elements, region, materials, robot.length, height, axis,
        straight if axis.bent else None, in_layers=True,
    )  # fmt: skip


def coarse_elements(robot: Robot) -> Elements:
    """Return numbers of elements that every robot of segments can be meshed with."""
    several = any(len(piece.lumens) > 1 for piece in robot.pieces)
    cornered = not several and any(not piece.lumens or piece.outer[0].shape == "rectangle" for piece in robot.pieces)
    return Elements(around=8 if cornered else 6, along=max(10, least_layers(robot.pieces)))
