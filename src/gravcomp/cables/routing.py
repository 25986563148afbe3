"""Routes of a robot's cables through its body at rest, or through its disks.

A force on one point or along one line of a solid sinks into it without limit as the mesh is refined. So a cable of a segment
moves with whole sections, as in the theory of rods: it lies at p + x f_1 + y f_2 with the functionals of `mesh.sections`, which
spread its force over the section as a rod's stress is. The same holds in a body from a file, wherever its cross-section is one
region. Where it is not, and where via points are given for segments, a cable is attached to the points of the body.
"""

import dataclasses

import numpy as np

from gravcomp.cables.disks import disk_heights, holes
from gravcomp.description import Cable, Robot
from gravcomp.mesh.embedding import Embedding, embed
from gravcomp.mesh.mesh import Mesh, MeshError
from gravcomp.mesh.sections import is_one_region, section_functionals

# How far outside its element a point may lie in a mesh from a file, in local coordinates: facets cut a little off a round
# body. For segments the description has been checked: the cable runs inside the walls that the facets approximate.
_TOLERANCE = 0.1


@dataclasses.dataclass(frozen=True)
class Route:
    """The points that a cable slides through, first to last.

    points: p points on the mesh; smooth (p,): whether the cable follows a smooth curve from the point before through this one to
    the next one, with this one half way, as it does through the middle of an element; elsewhere it runs straight between points.
    """

    points: Embedding
    smooth: np.ndarray

    def renumbered(self, order: np.ndarray) -> "Route":
        """Return the same route on the mesh renumbered by `order`."""
        return dataclasses.replace(self, points=self.points.renumbered(order))


def route_cables(robot: Robot, mesh: Mesh) -> list[Route]:
    """Return the routes of the cables, attached to the mesh.

    In a segment with disks a cable runs from disk to disk; else a cable given by angle and radius slides through every station
    of the mesh between its start and its end. Raises MeshError for a cable that leaves the body.
    """
    guided = disk_heights(robot)
    sections: dict[float, np.ndarray | None] = {}
    return [_route(robot, mesh, cable, guided, sections) for cable in robot.cables]


def _unit(robot: Robot) -> str:
    """Return the unit of a body from a file, with the reason: a wrong one lets cables leave it."""
    return f" (the file: {robot.body.placed().unit_reason})" if robot.body is not None else ""


def _route(robot: Robot, mesh: Mesh, cable: Cable, guided: np.ndarray, known: dict[float, np.ndarray | None]) -> Route:
    """The route of one cable; guided (d,): the heights of the disks; known: what `_add_sections` found for other cables."""
    points, at_disk = _via_points(robot, cable, mesh.stations, guided)
    smooth = _smooth(points[:, 2], mesh.stations, at_disk, 1e-6 * robot.length)
    at_section = at_disk
    from_file = robot.body is not None
    if cable.via_points is not None or not mesh.in_layers:
        smooth[:] = False
    if from_file or cable.via_points is None:
        at_section = np.ones(len(points), dtype=bool)
    heights = points[:, 2].tolist()
    _add_sections(mesh, [height for height, at in zip(heights, at_section) if at], known, from_file)
    at_section = at_section & np.array([known.get(height) is not None for height in heights])
    inside = None
    if from_file or not at_section.all():  # segments have been checked: the cable runs inside the walls
        try:
            inside = embed(mesh, mesh.axis.points(points if from_file else points[~at_section]))
        except MeshError as error:
            raise MeshError(f"cable '{cable.name}' leaves the body: {error}{_unit(robot)}") from error
        worst = int(np.argmax(inside.outside))
        if from_file and inside.outside[worst] > _TOLERANCE:
            x, y, z = points[worst] * 1e3
            raise MeshError(
                f"cable '{cable.name}' leaves the body at ({x:.3g}, {y:.3g}, {z:.3g}) mm; it must run inside{_unit(robot)}"
            )
        if from_file:
            inside = inside.of(~at_section)
    parts = []
    if at_section.any():
        rows = np.array([known[height] for height, at in zip(heights, at_section) if at])
        parts.append(holes(points[at_section, :2], rows))
    if inside is not None and not at_section.all():
        parts.append(inside)
    return Route(parts[0] if len(parts) == 1 else _merged(parts, at_section), smooth)


def _add_sections(mesh: Mesh, heights: list[float], known: dict[float, np.ndarray | None], from_file: bool) -> None:
    """Add the functionals (3, n) of the sections at the heights to `known`; None where a body from a file has no whole one."""
    missing = [height for height in dict.fromkeys(heights) if height not in known]
    if not from_file:
        known.update(zip(missing, section_functionals(mesh, np.array(missing)).reshape(-1, 3, len(mesh.nodes))))
        return
    for height in missing:
        try:
            known[height] = section_functionals(mesh, np.array([height])) if is_one_region(mesh, height) else None
        except MeshError:
            known[height] = None


def _smooth(s: np.ndarray, stations: np.ndarray, at_disk: np.ndarray, slack: float) -> np.ndarray:
    """Which of the points at the arc lengths s (p,) are the middle of an element between two others of its ends (p,)."""
    smooth = np.zeros(len(s), dtype=bool)
    for k in range(1, len(s) - 1):
        middle = int(np.argmin(np.abs(stations - s[k])))
        if middle % 2 == 1 and middle + 1 < len(stations) and not at_disk[k - 1 : k + 2].any():
            smooth[k] = np.abs(stations[middle - 1 : middle + 2] - s[k - 1 : k + 2]).max() < slack
    return smooth


def _merged(parts: list[Embedding], at_section: np.ndarray) -> Embedding:
    """The points at sections and those in the body in one embedding, in their order along the cable."""
    width = max(part.nodes.shape[1] for part in parts)
    nodes, weights = np.zeros((len(at_section), width), dtype=np.int64), np.zeros((len(at_section), width))
    outside = np.zeros(len(at_section))
    for part, rows in zip(parts, (np.flatnonzero(at_section), np.flatnonzero(~at_section))):
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
