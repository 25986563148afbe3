"""Surfaces that follow the backbone: each vertex keeps its place in the cross-section at its station.

    vertex = p(station) + R(station) (x, y, 0)

so that walls, lumen and cables of a robot, and any surface read from a file, are deformed alike.
"""

import dataclasses
import functools
import math

import numpy as np

from gravcomp.description import Cable, Robot
from gravcomp.view.backbone import Backbone

AROUND = 36  # vertices around the body
FILLET = 0.0006  # m, at the rim of the end face


@dataclasses.dataclass(frozen=True)
class Skin:
    """station (v,), offset (v, 2) m in the cross-section, faces (f, 3)."""

    station: np.ndarray
    offset: np.ndarray
    faces: np.ndarray

    def on(self, backbone: Backbone) -> np.ndarray:
        """The vertices (v, 3) on a backbone, float32."""
        unique, inverse = self._rings
        position, rotation = backbone.at(unique)
        x, y = self.offset[:, :1], self.offset[:, 1:]
        vertices = position[inverse] + rotation[inverse, :, 0] * x + rotation[inverse, :, 1] * y
        return vertices.astype(np.float32)

    @functools.cached_property
    def _rings(self) -> tuple[np.ndarray, np.ndarray]:
        return np.unique(self.station, return_inverse=True)


def joined(skins: list[Skin]) -> tuple[Skin, list[slice]]:
    """One skin of many, deformed at once, and where each one's vertices are in it. Its faces are those of none."""
    ends = np.cumsum([0] + [len(skin.station) for skin in skins])
    parts = [slice(a, b) for a, b in zip(ends, ends[1:])]
    station, offset = (np.concatenate([getattr(skin, name) for skin in skins]) for name in ("station", "offset"))
    return Skin(station, offset, np.zeros((0, 3), int)), parts


def wall_skins(robot: Robot) -> list[Skin]:
    """The outer surface, one skin a segment; of a body from a file its whole surface."""
    if robot.body is not None:
        return [_body_skin(robot)]
    skins, z = [], 0.0
    for segment in robot.segments:
        rings = max(8, round(segment.full_length / 0.002))
        heights = np.linspace(z, z + segment.full_length, rings + 1)
        radii = np.full(rings + 1, segment.outer_diameter / 2)
        z += segment.full_length
        if segment is robot.segments[-1]:
            angle = np.linspace(0.0, math.pi / 2, 5)
            heights = np.concatenate([heights[:-1], z - FILLET + FILLET * np.sin(angle), [z]])
            inner = segment.lumen_diameter / 2
            radii = np.concatenate([radii[:-1], radii[-1] - FILLET + FILLET * np.cos(angle), [inner]])
        skins.append(revolved(radii, heights, robot.length))
    return skins


def lumen_skin(robot: Robot) -> Skin | None:
    """The wall of the working channel, seen from inside; none for a body from a file."""
    if robot.body is not None:
        return None
    radii, heights, z = [], [], 0.0
    for segment in robot.segments:
        along = np.linspace(z, z + segment.full_length, 16)
        heights += along.tolist()
        radii += [segment.lumen_diameter / 2] * len(along)
        z += segment.full_length
    return revolved(np.array(radii)[::-1], np.array(heights)[::-1], robot.length, around=24)


def cable_skin(robot: Robot, cable: Cable, radius: float = 0.0006, around: int = 8) -> Skin:
    """A cable as a tube of `radius` (m) from where it enters the body to where it is fixed."""
    z = np.linspace(cable.start, robot.cable_end(cable), 32)
    centre = cable_offset(cable, z)
    angle = np.linspace(0.0, 2 * math.pi, around, endpoint=False)
    circle = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    offset = (centre[:, None, :] + circle[None, :, :]).reshape(-1, 2)
    return Skin(np.repeat(z / robot.length, around), offset, _quads(len(z), around))


def cable_offset(cable: Cable, z: np.ndarray) -> np.ndarray:
    """Where a cable passes the cross-sections at the heights z (k,): (k, 2) m in the sections' own axes."""
    if cable.via_points is not None:
        via = np.array(cable.via_points)
        return np.stack([np.interp(z, via[:, 2], via[:, 0]), np.interp(z, via[:, 2], via[:, 1])], axis=1)
    return np.tile(cable.radius * np.array([math.cos(cable.angle), math.sin(cable.angle)]), (len(z), 1))


def line_skin(radius: float, around: int = 10, rings: int = 48) -> Skin:
    """A thin tube along the backbone itself."""
    return revolved(np.full(rings, radius), np.linspace(0.0, 1.0, rings), 1.0, around)


def revolved(radii: np.ndarray, heights: np.ndarray, length: float, around: int = AROUND) -> Skin:
    """A profile (k,) of radii and heights (m) turned about the axis; outward when it goes upward."""
    angle = np.linspace(0.0, 2 * math.pi, around, endpoint=False)
    offset = radii[:, None, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)[None]
    return Skin(np.repeat(heights / length, around), offset.reshape(-1, 2), _quads(len(radii), around))


def _quads(rings: int, around: int) -> np.ndarray:
    i, j = np.meshgrid(np.arange(rings - 1), np.arange(around), indexing="ij")
    a, b = i * around + j, i * around + (j + 1) % around
    c, d = a + around, b + around
    return np.concatenate([np.stack([a, b, d], -1).reshape(-1, 3), np.stack([a, d, c], -1).reshape(-1, 3)])


def _body_skin(robot: Robot) -> Skin:
    from gravcomp.mesh import body_mesh

    mesh = body_mesh(robot)
    corners = mesh.elements[:, :4]
    faces = np.concatenate([corners[:, face] for face in ([0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2])])
    _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    surface = faces[first[count == 1]]
    used, renumbered = np.unique(surface, return_inverse=True)
    nodes = mesh.nodes[used]
    return Skin(nodes[:, 2] / robot.length, nodes[:, :2], renumbered.reshape(surface.shape))
