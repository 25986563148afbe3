"""The surface of a body: outer walls with their end face and disks, lumens, or the surface of a body from a file."""

import dataclasses
import math

import numpy as np

from gravcomp.description import Outline, Piece, Robot, Segment
from gravcomp.mesh_files.repair_volume import boundary_triangles
from gravcomp.view.skin import AROUND, Skin, merged, quads, revolved

# Rings along the robot, and the fewest along a piece.
_RINGS, _FEWEST = 50, 8
_AROUND_LUMEN = 24
_RIM = 0.13  # radius of the rim of the end face, as part of half the width


def wall_skins(robot: Robot, around: int = AROUND, rings: int = _RINGS) -> list[Skin]:
    """Return the outer surface: one skin per segment, with its disks, or the whole surface of a body from a file.

    around, rings: numbers of vertices around the body and along the robot.
    """
    if robot.body is not None:
        return [_body_skin(robot)]
    skins = []
    before: Outline | None = None
    for segment in robot.segments:
        pieces = [piece.visible for piece in robot.pieces if piece.segment == segment.name]
        last = segment is robot.segments[-1]
        parts = [_wall(robot, pieces, before, around, rings, last)]
        if last and len(pieces[-1].lumens) > 1:
            parts.append(_pierced_face(robot, pieces[-1]))
        if segment.disks:
            parts += _disks(robot, segment, pieces[0].start, around)
        before = pieces[-1].outer[1]
        skins.append(merged(parts))
    return skins


def lumen_skin(robot: Robot) -> Skin | None:
    """Return the walls of the lumens, facing inward; None for a solid body and for one from a file."""
    parts = []
    angle = _angles(_AROUND_LUMEN)
    for piece in (piece.visible for piece in robot.pieces):
        heights = _heights(robot, piece, _RINGS)[::-1]
        for base, tip in piece.lumens:
            share = ((heights - piece.start) / piece.length)[:, None, None]
            offset = (1.0 - share) * base.boundary(angle) + share * tip.boundary(angle)
            parts.append(_skin(heights / robot.length, offset))
    return merged(parts) if parts else None


def _wall(robot: Robot, pieces: list[Piece], before: Outline | None, around: int, rings: int, last: bool) -> Skin:
    """The outer wall of a segment; where it begins with another outline than `before`, with the step between them."""
    angle = _angles(around)
    heights: list[float] = []
    offsets: list[np.ndarray] = []
    if before is not None and not before.alike(pieces[0].outer[0]):
        heights, offsets = [pieces[0].start], [before.boundary(angle)]
    for piece in pieces:
        for height in _heights(robot, piece, rings):
            heights.append(float(height))
            offsets.append(piece.section(float(height))[0].boundary(angle))
    if last and len(pieces[-1].lumens) < 2:
        end, outline = heights[-1], pieces[-1].outer[1]
        rim = _RIM * min(outline.half_width, outline.half_height)
        if pieces[-1].lumens:  # the rim leaves half of the wall
            rim = min(rim, 0.5 * _wall_thickness(outline, pieces[-1].lumens[0][1]))
        heights, offsets = heights[:-1], offsets[:-1]
        for turn in np.linspace(0.0, math.pi / 2, 5):
            heights.append(end - rim + rim * math.sin(turn))
            offsets.append(_shrunk(outline, rim * (1.0 - math.cos(turn))).boundary(angle))
        heights.append(end)
        face = (
            pieces[-1].lumens[0][1]
            if pieces[-1].lumens
            else _shrunk(outline, 0.999 * min(outline.half_width, outline.half_height))
        )
        offsets.append(face.boundary(angle))
    return _skin(np.array(heights) / robot.length, np.array(offsets))


def _heights(robot: Robot, piece: Piece, rings: int) -> np.ndarray:
    count = max(2 if piece.length < 0.02 * robot.length else _FEWEST, round(rings * piece.length / robot.length))
    return np.linspace(piece.start, piece.start + piece.length, count + 1)


def _pierced_face(robot: Robot, piece: Piece) -> Skin:
    """The end face of a segment with several lumens."""
    from gravcomp.mesh.section_division import divided_section

    cells, place = divided_section(piece.outer[1], [lumen[1] for lumen in piece.lumens], 12, 1)
    corners = [(cells[:, i, j], cells[:, i + 1, j], cells[:, i + 1, j + 1], cells[:, i, j + 1]) for i in (0, 1) for j in (0, 1)]
    faces = [triangle for a, b, c, d in corners for triangle in (np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1))]
    return Skin(np.full(len(place), (piece.start + piece.length) / robot.length), place, np.concatenate(faces))


def _disks(robot: Robot, segment: Segment, base: float, around: int) -> list[Skin]:
    assert segment.disks is not None  # the caller
    skins, radius = [], segment.disks.outer_diameter / 2
    thickness = segment.disks.thickness
    for height in segment.disks.heights(segment.length):
        low = base + min(max(height - thickness / 2, 0.0), segment.length - thickness)
        high = low + thickness
        skins.append(revolved(np.array([1e-3, 1.0, 1.0, 1e-3]) * radius, np.array([low, low, high, high]), robot.length, around))
    return skins


def _wall_thickness(outline: Outline, lumen: Outline) -> float:
    return float(outline.reach(lumen.x, lumen.y, _angles(48)).min()) - lumen.half_width


def _shrunk(outline: Outline, by: float) -> Outline:
    return dataclasses.replace(outline, half_width=outline.half_width - by, half_height=outline.half_height - by)


def _angles(around: int) -> np.ndarray:
    return np.linspace(0.0, 2 * math.pi, around, endpoint=False)


def _skin(station: np.ndarray, offset: np.ndarray) -> Skin:
    """A skin from rings: station (k,), offset (k, around, 2)."""
    rings, around, _ = offset.shape
    return Skin(np.repeat(station, around), offset.reshape(-1, 2), quads(rings, around))


def _body_skin(robot: Robot) -> Skin:
    from gravcomp.mesh import body_mesh

    mesh = body_mesh(robot)
    used, faces = np.unique(boundary_triangles(mesh.elements), return_inverse=True)
    nodes = mesh.straight[used]
    return Skin(nodes[:, 2] / robot.length, nodes[:, :2], faces.reshape(-1, 3))
