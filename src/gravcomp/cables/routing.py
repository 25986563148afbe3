"""Routes of a robot's cables through its body at rest, or through its disks."""

import numpy as np

from gravcomp.cables.disks import disk_heights, holes
from gravcomp.description import Cable, Robot
from gravcomp.mesh.embedding import Embedding, embed
from gravcomp.mesh.mesh import Mesh, MeshError
from gravcomp.mesh.sections import section_functionals

# How far outside its element a point may lie in a mesh from a file, in local coordinates: facets cut a little off a round
# body. For segments the description has been checked: the cable runs inside the walls that the facets approximate.
_TOLERANCE = 0.1


def route_cables(robot: Robot, mesh: Mesh) -> list[Embedding]:
    """Return the points that every cable slides through, first to last, attached to the mesh.

    In a segment with disks they are the holes of the disks; else a cable given by angle and radius slides through every
    station of the mesh between its start and its end. Raises MeshError for a cable that leaves the body.
    """
    guided = disk_heights(robot)
    sections = section_functionals(mesh, guided).reshape(len(guided), 3, -1) if len(guided) else np.zeros((0, 3, 0))
    return [_route(robot, mesh, cable, guided, sections) for cable in robot.cables]


def _route(robot: Robot, mesh: Mesh, cable: Cable, guided: np.ndarray, sections: np.ndarray) -> Embedding:
    """The route of one cable; guided (d,): the heights of the disks, sections (d, 3, n): the functionals of their sections."""
    points, at_disk = _via_points(robot, cable, mesh.stations, guided)
    parts = []
    if at_disk.any():
        disk = np.abs(points[at_disk, 2:] - guided).argmin(axis=1)
        parts.append(holes(points[at_disk, :2], sections[disk]))
    if not at_disk.all():
        try:
            route = embed(mesh, mesh.axis.points(points[~at_disk]))
        except MeshError as error:
            raise MeshError(f"cable '{cable.name}' leaves the body: {error}") from error
        worst = int(np.argmax(route.outside))
        if robot.body is not None and route.outside[worst] > _TOLERANCE:
            x, y, z = points[~at_disk][worst] * 1e3
            raise MeshError(f"cable '{cable.name}' leaves the body at ({x:.3g}, {y:.3g}, {z:.3g}) mm; it must run inside")
        parts.append(route)
    if len(parts) == 1:
        return parts[0]
    return _merged(parts, at_disk)


def _merged(parts: list[Embedding], at_disk: np.ndarray) -> Embedding:
    """The points at disks and those in the body in one embedding, in their order along the cable."""
    width = max(part.nodes.shape[1] for part in parts)
    nodes, weights = np.zeros((len(at_disk), width), dtype=np.int64), np.zeros((len(at_disk), width))
    outside = np.zeros(len(at_disk))
    for part, rows in zip(parts, (np.flatnonzero(at_disk), np.flatnonzero(~at_disk))):
        columns = part.nodes.shape[1]
        nodes[np.ix_(rows, np.arange(columns))], weights[np.ix_(rows, np.arange(columns))] = part.nodes, part.weights
        outside[rows] = part.outside
    return Embedding(nodes, weights, outside)


def _via_points(robot: Robot, cable: Cable, stations: np.ndarray, guided: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points (p, 3) of the straightened robot, and which of them are holes of disks (p,)."""
    slack = 1e-6 * robot.length
    if cable.via_points is not None:
        points = np.array(cable.via_points)
        return points, np.zeros(len(points), dtype=bool)
    end = robot.cable_end(cable)
    backbones = _backbones(robot)
    in_backbone = np.array([any(low - slack < s < high + slack for low, high in backbones) for s in stations])
    candidates = np.unique(np.concatenate([stations[~in_backbone], guided]))
    between = candidates[(candidates > cable.start + slack) & (candidates < end - slack)]
    s = np.concatenate([[cable.start], between, [end]])
    s = s[np.concatenate([[True], np.diff(s) > slack])]
    at_disk = np.array([bool(len(guided)) and np.abs(guided - value).min() < slack for value in s])
    for index in (0, len(s) - 1):
        if not at_disk[index] and any(low + slack < s[index] < high - slack for low, high in backbones):
            raise MeshError(
                f"cable '{cable.name}' {'ends' if index else 'starts'} at {s[index] * 1e3:g} mm, between two disks;"
                f" there are disks at {', '.join(f'{1e3 * height:g}' for height in guided)} mm"
            )
    place = np.array([robot.cable_place(cable, value) for value in s])
    return np.column_stack([place, s]), at_disk


def _backbones(robot: Robot) -> list[tuple[float, float]]:
    """From where to where (m) segments with disks reach."""
    spans, base = [], 0.0
    for segment in robot.segments:
        if segment.disks:
            spans.append((base, base + segment.length))
        base += segment.full_length
    return spans
