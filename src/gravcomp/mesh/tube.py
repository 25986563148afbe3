"""Meshes of a row of segments, built from their dimensions: graded toward the clamp, whose corner is singular.

A division of the cross-section (`section_division`) is swept along the axis in layers (`layers`). Its cells become 20-node
hexahedra, or six tetrahedra each (Kuhn's division). The robot is meshed straight and then laid along its axis at rest.
"""

import dataclasses
import itertools

import numpy as np

from gravcomp.description import Elements, Robot
from gravcomp.mesh.elements import is_hexahedron, reference_nodes
from gravcomp.mesh.layers import layers_of, least_layers
from gravcomp.mesh.mesh import Mesh
from gravcomp.mesh.quadratic import TET_EDGES
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

    numbers, region = [], []
    # Nodes of an element in (radial, around, along) half steps of its cell.
    patterns = [np.rint(reference_nodes(kind) + 1).astype(int)] if is_hexahedron(kind) else _kuhn(quadratic=kind == "tet10")
    levels_high = 2 * len(heights) - 1
    for pattern in patterns:
        for layer, piece in enumerate(piece_of_layer):
            cells = grid.cells[grid.present[piece]]
            planar = cells[:, pattern[:, 0], pattern[:, 1]]
            numbers.append(planar * levels_high + 2 * layer + pattern[:, 2])
            region.append(np.full(len(planar), piece))
    used, elements_of = np.unique(np.concatenate(numbers), return_inverse=True)
    connectivity = elements_of.reshape(-1, len(patterns[0]))
    planar, level = used // levels_high, used % levels_high

    # A section lies between the planes at both ends of its piece, and changes linearly from one to the other.
    ends = np.concatenate([[0.0], np.cumsum([piece.length for piece in pieces])])
    height = _halved(heights)
    piece_of_level = np.repeat(piece_of_layer, 2)[np.minimum(np.arange(levels_high), levels_high - 2)]
    part = (height - ends[piece_of_level]) / np.diff(ends)[piece_of_level]
    base, part = piece_of_level[level], part[level][:, None]
    low_place, high_place = grid.place[base, planar], grid.place[base + 1, planar]
    # In the plane itself the other end may not be known: a wall may end there.
    place = np.where(part <= 0.0, low_place, np.where(part >= 1.0, high_place, (1.0 - part) * low_place + part * high_place))
    straight = np.column_stack([place, height[level]])
    materials = tuple(piece.material for piece in pieces)
    axis = rest_axis(robot)
    return Mesh(
        kind, axis.points(straight), connectivity, np.concatenate(region), materials, robot.length, height, axis,
        straight if axis.bent else None,
    )  # fmt: skip


def coarse_elements(robot: Robot) -> Elements:
    """Return numbers of elements that every robot of segments can be meshed with."""
    several = any(len(piece.lumens) > 1 for piece in robot.pieces)
    cornered = not several and any(not piece.lumens or piece.outer[0].shape == "rectangle" for piece in robot.pieces)
    return Elements(around=8 if cornered else 6, along=max(10, least_layers(robot.pieces)))


def with_coarse_elements(robot: Robot) -> Robot:
    """Return the robot with a mesh for quick looks; unchanged where its own has fewer cells, or its body is from a file."""
    if robot.body is not None:
        return robot
    coarse = coarse_elements(robot)
    if robot.elements is not None and _cells(robot.elements) < _cells(coarse):
        return robot
    return dataclasses.replace(robot, elements=coarse)


def _cells(elements: Elements) -> int:
    return elements.around * elements.along * elements.radial


def _halved(values: np.ndarray) -> np.ndarray:
    """The values and the means between them."""
    return np.interp(np.arange(2 * len(values) - 1) / 2.0, np.arange(len(values)), values)


def _kuhn(quadratic: bool) -> list[np.ndarray]:
    """The six tetrahedra of a cell: one for each order of walking its edges from the first corner to the opposite one."""
    tets = []
    for order in itertools.permutations(range(3)):
        corners = [np.zeros(3, dtype=int)]
        for axis in order:
            corners.append(corners[-1] + 2 * np.eye(3, dtype=int)[axis])
        if np.linalg.det(np.array(corners[1:]) - corners[0]) < 0:
            corners[1], corners[2] = corners[2], corners[1]
        mids = [(corners[a] + corners[b]) // 2 for a, b in TET_EDGES] if quadratic else []
        tets.append(np.array(corners + mids))
    return tets
