"""Surfaces that follow the backbone: each vertex keeps its position in the cross-section at its station.

    vertex = p(station) + R(station) (x, y, 0)

Walls, lumens, disks and cables of a robot, and surfaces from a file (`wall`), are deformed in the same way.
"""

import dataclasses
import functools
import math

import numpy as np

from gravcomp.description import Cable, Robot
from gravcomp.view.backbone import Backbone

AROUND = 40  # vertices around the body; a multiple of 8, so that rectangles have their corners
_CABLE_POINTS = 32
_CABLE, _FREE_CABLE = 0.13, 0.04  # radius of a cable, as part of half the width of the body


@dataclasses.dataclass(frozen=True)
class Skin:
    """A surface: station (v,), offset (v, 2) in the cross-section in m, faces (f, 3)."""

    station: np.ndarray
    offset: np.ndarray
    faces: np.ndarray

    def on(self, backbone: Backbone) -> np.ndarray:
        """Return the vertices (v, 3) on a backbone in m, float32."""
        unique, inverse = self._rings
        position, rotation = backbone.at(unique)
        x, y = self.offset[:, :1], self.offset[:, 1:]
        vertices = position[inverse] + rotation[inverse, :, 0] * x + rotation[inverse, :, 1] * y
        return vertices.astype(np.float32)

    @functools.cached_property
    def _rings(self) -> tuple[np.ndarray, np.ndarray]:
        return np.unique(self.station, return_inverse=True)


def joined(skins: list[Skin]) -> tuple[Skin, list[slice]]:
    """Return one skin without faces from many, to deform them together, and the slice of each one's vertices."""
    ends = np.cumsum([0] + [len(skin.station) for skin in skins])
    parts = [slice(a, b) for a, b in zip(ends, ends[1:])]
    station, offset = (np.concatenate([getattr(skin, name) for skin in skins]) for name in ("station", "offset"))
    return Skin(station, offset, np.zeros((0, 3), int)), parts


def merged(skins: list[Skin]) -> Skin:
    """Return one skin with the vertices and faces of all."""
    together, parts = joined(skins)
    faces = [skin.faces + part.start for skin, part in zip(skins, parts)]
    return Skin(together.station, together.offset, np.concatenate(faces))


def cable_skin(robot: Robot, cable: Cable, radius: float | None = None, around: int = 8) -> Skin:
    """Return a cable as a tube of `radius` (m), from its entry into the body to its fixed end; straight between disks."""
    if radius is None:  # outside a backbone cables stand alone and are drawn thinner
        radius = half_width(robot) * (_FREE_CABLE if any(segment.disks for segment in robot.segments) else _CABLE)
    line = cable_line(robot, cable)
    angle = np.linspace(0.0, 2 * math.pi, around, endpoint=False)
    circle = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    offset = (line.offset[:, None, :] + circle[None, :, :]).reshape(-1, 2)
    return Skin(np.repeat(line.station, around), offset, quads(len(line.station), around))


def cable_line(robot: Robot, cable: Cable) -> Skin:
    """Return the points of a cable, from its entry into the body to its fixed end, as a skin without faces."""
    z = np.linspace(cable.via_points[0][2] if cable.via_points else cable.start, robot.cable_end(cable), _CABLE_POINTS)
    z = _guided(robot, z)
    places = np.array([robot.cable_place(cable, float(height)) for height in z])
    return Skin(z / robot.length, places, np.zeros((0, 3), int))


def half_width(robot: Robot) -> float:
    """Return half the largest width (m) of the body, disks included; for a body from a file, a part of its length."""
    widths = [max(o.half_width, o.half_height) for piece in robot.pieces for o in piece.visible.outer]
    widths += [segment.disks.outer_diameter / 2 for segment in robot.segments if segment.disks]
    return max(widths, default=0.045 * robot.length)


def _guided(robot: Robot, z: np.ndarray) -> np.ndarray:
    """The heights (k,) without those between disks, and with those of the disks."""
    base, low, high = 0.0, z[0], z[-1]
    for segment in robot.segments:
        if segment.disks:
            disks = base + np.array([0.0, *segment.disks.heights(segment.length)])
            z = np.concatenate([z[(z <= base) | (z >= base + segment.length)], disks[(disks >= low) & (disks <= high)]])
        base += segment.full_length
    return np.unique(z)


def line_skin(radius: float, around: int = 10, rings: int = 48) -> Skin:
    """Return a thin tube of `radius` (m) along the backbone."""
    return revolved(np.full(rings, radius), np.linspace(0.0, 1.0, rings), 1.0, around)


def revolved(radii: np.ndarray, heights: np.ndarray, length: float, around: int = AROUND) -> Skin:
    """Return a surface of revolution from radii and heights (k,) in m; it faces outward when the heights increase."""
    angle = np.linspace(0.0, 2 * math.pi, around, endpoint=False)
    offset = radii[:, None, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)[None]
    return Skin(np.repeat(heights / length, around), offset.reshape(-1, 2), quads(len(radii), around))


def quads(rings: int, around: int) -> np.ndarray:
    """Return the faces (f, 3) of rings of vertices, each joined to the next one."""
    i, j = np.meshgrid(np.arange(rings - 1), np.arange(around), indexing="ij")
    a, b = i * around + j, i * around + (j + 1) % around
    c, d = a + around, b + around
    return np.concatenate([np.stack([a, b, d], -1).reshape(-1, 3), np.stack([a, d, c], -1).reshape(-1, 3)])
