"""Surfaces that follow the backbone: each vertex keeps its position in the cross-section at its station.

    vertex = p(station) + R(station) (x, y, 0)

Walls, lumen and cables of a robot, and surfaces from a file, are deformed in the same way.
"""

import dataclasses
import functools
import math

import numpy as np
import viser

from gravcomp.description import Cable, Robot
from gravcomp.view.backbone import Backbone
from gravcomp.view.colours import Rgb
from gravcomp.view.scale import scaled

AROUND = 36  # vertices around the body
FILLET = 0.0006  # m, radius of the rim of the end face


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


def wall_skins(robot: Robot) -> list[Skin]:
    """Return the outer surface: one skin per segment, or the whole surface of a body from a file."""
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
    """Return the wall of the working channel, facing inward; None for a body from a file."""
    if robot.body is not None:
        return None
    radii: list[float] = []
    heights: list[float] = []
    z = 0.0
    for segment in robot.segments:
        along = np.linspace(z, z + segment.full_length, 16)
        heights += along.tolist()
        radii += [segment.lumen_diameter / 2] * len(along)
        z += segment.full_length
    return revolved(np.array(radii)[::-1], np.array(heights)[::-1], robot.length, around=24)


def cable_skin(robot: Robot, cable: Cable, radius: float = 0.0006, around: int = 8) -> Skin:
    """Return a cable as a tube of `radius` (m), from its entry into the body to its fixed end."""
    z = np.linspace(cable.start, robot.cable_end(cable), 32)
    centre = cable_offset(cable, z)
    angle = np.linspace(0.0, 2 * math.pi, around, endpoint=False)
    circle = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    offset = (centre[:, None, :] + circle[None, :, :]).reshape(-1, 2)
    return Skin(np.repeat(z / robot.length, around), offset, _quads(len(z), around))


def cable_offset(cable: Cable, z: np.ndarray) -> np.ndarray:
    """Return the positions (k, 2) of a cable in m, in the axes of the cross-sections at the heights z (k,)."""
    if cable.via_points is not None:
        via = np.array(cable.via_points)
        return np.stack([np.interp(z, via[:, 2], via[:, 0]), np.interp(z, via[:, 2], via[:, 1])], axis=1)
    assert cable.radius is not None and cable.angle is not None  # both are given for a cable without via points
    return np.tile(cable.radius * np.array([math.cos(cable.angle), math.sin(cable.angle)]), (len(z), 1))


def line_skin(radius: float, around: int = 10, rings: int = 48) -> Skin:
    """Return a thin tube of `radius` (m) along the backbone."""
    return revolved(np.full(rings, radius), np.linspace(0.0, 1.0, rings), 1.0, around)


def revolved(radii: np.ndarray, heights: np.ndarray, length: float, around: int = AROUND) -> Skin:
    """Return a surface of revolution from radii and heights (k,) in m; it faces outward when the heights increase."""
    angle = np.linspace(0.0, 2 * math.pi, around, endpoint=False)
    offset = radii[:, None, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)[None]
    return Skin(np.repeat(heights / length, around), offset.reshape(-1, 2), _quads(len(radii), around))


def add_skin(
    scene: viser.SceneApi,
    name: str,
    skin: Skin,
    backbone: Backbone,
    colour: Rgb,
    *,
    opacity: float | None = None,
    cast_shadow: bool = True,
) -> viser.MeshHandle:
    """Add a skin on a backbone to a scene."""
    return scene.add_mesh_simple(
        name, scaled(skin.on(backbone)), skin.faces, color=colour, side="front", opacity=opacity, cast_shadow=cast_shadow
    )


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
    nodes = mesh.straight[used]
    return Skin(nodes[:, 2] / robot.length, nodes[:, :2], renumbered.reshape(surface.shape))
