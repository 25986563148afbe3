"""A section with several lumens, divided into one region around each: the points that are nearer to its wall than to another's.

The regions' borders are the outline and arcs of hyperbolas, the additively weighted Voronoi diagram of the lumens (Apollonius).
Every region is star-shaped about its lumen's middle c_i: on the ray from it in the direction u, the border with lumen j lies at

    rho = (d^2 - s^2) / (2 (u . D + s)),    D = c_j - c_i,  d = |D|,  s = r_j - r_i.
"""

import dataclasses
import itertools
import math

import numpy as np

from gravcomp.description import BlendedOutline, Outline

_RAYS = 2880
_HALVINGS = 45
# Vertices nearer than this part of the section's size, about two rays apart, are one.
_SAME = 5e-3
# A stretch of a border is left out when it is shorter than this part of the smallest lumen's and the smallest wall's size.
_SHORTEST = 0.3


@dataclasses.dataclass
class Border:
    """A stretch of the border between two regions, or (owner, None) of a region and the outside.

    ends: its two vertices; points (p, 2): a fine polyline from the first to the second; angle: how far (rad) it reaches around
    the lumen, the larger of both.
    """

    owner: int
    other: int | None
    ends: tuple[int, int]
    points: np.ndarray
    angle: float


@dataclasses.dataclass
class Diagram:
    """vertices (v, 2); borders; loops: for every lumen its borders counterclockwise, each with whether it runs backwards."""

    vertices: np.ndarray
    borders: list[Border]
    loops: list[list[tuple[int, bool]]]


def diagram_of(outline: Outline | BlendedOutline, lumens: list[Outline], cornered: bool) -> Diagram:
    """Divide the section. cornered: vertices lie at the parameters of the outline at which a rectangle has its corners."""
    arcs = [_arcs(outline, lumens, index, cornered) for index in range(len(lumens))]
    vertices: list[np.ndarray] = []
    size = math.hypot(outline.half_width, outline.half_height)

    def vertex(point: np.ndarray) -> int:
        for number, known in enumerate(vertices):
            if np.hypot(*(known - point)) < _SAME * size:
                return number
        vertices.append(point)
        return len(vertices) - 1

    borders: list[Border] = []
    loops: list[list[tuple[int, bool]]] = []
    known: dict[tuple[int, int, frozenset[int]], int] = {}
    for index, around in enumerate(arcs):
        loop = []
        for label, low, high in around:
            angles = np.linspace(low, high, 65)
            points = _on_rays(outline, lumens, index, angles)
            ends = vertex(points[0]), vertex(points[-1])
            if ends[0] == ends[1] and high - low < 1.0:  # four regions meet in one point
                continue
            if label >= 0 and (twin := known.get((label, index, frozenset(ends)))) is not None:
                borders[twin].angle = max(borders[twin].angle, high - low)
                loop.append((twin, True))
                continue
            known[index, label, frozenset(ends)] = len(borders)
            loop.append((len(borders), False))
            borders.append(Border(index, label if label >= 0 else None, ends, points, high - low))
        loops.append(loop)
    return _without_short_borders(Diagram(np.array(vertices), borders, loops), outline, lumens)


def _on_rays(outline: Outline | BlendedOutline, lumens: list[Outline], index: int, angle: np.ndarray) -> np.ndarray:
    """Points (k, 2) of the border of a region on the rays at the angles (k,)."""
    own = lumens[index]
    radius, _ = _nearest(outline, lumens, index, angle, False)
    return np.array([own.x, own.y]) + radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def _nearest(
    outline: Outline | BlendedOutline, lumens: list[Outline], index: int, angle: np.ndarray, cornered: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Distance (k,) from the lumen's middle to the border on each ray, and what lies there: a lumen's number, or -1 - side."""
    own = lumens[index]
    radius = outline.reach(own.x, own.y, angle)
    side = np.zeros(len(angle), dtype=int)
    if cornered:
        x, y = own.x + radius * np.cos(angle), own.y + radius * np.sin(angle)
        side = np.round(outline.parameter(x, y) / (math.pi / 2)).astype(int) % 4
    label = -1 - side
    for other, lumen in enumerate(lumens):
        if other == index:
            continue
        dx, dy, more = lumen.x - own.x, lumen.y - own.y, lumen.half_width - own.half_width
        towards = np.cos(angle) * dx + np.sin(angle) * dy + more
        with np.errstate(divide="ignore"):
            border = np.where(towards > 0, (dx * dx + dy * dy - more * more) / (2 * towards), np.inf)
        nearer = border < radius
        radius, label = np.where(nearer, border, radius), np.where(nearer, other, label)
    return radius, label


def _arcs(outline: Outline | BlendedOutline, lumens: list[Outline], index: int, cornered: bool) -> list[tuple[int, float, float]]:
    """The borders of a region: label, and the angles (rad) from which to which it reaches; counterclockwise."""
    angle = 2 * math.pi * (np.arange(_RAYS) + 0.37) / _RAYS  # no ray goes along an axis of symmetry
    labels = _nearest(outline, lumens, index, angle, cornered)[1]
    last = np.flatnonzero(labels != np.roll(labels, -1))  # the rays before a change
    low, high = angle[last], angle[last] + 2 * math.pi / _RAYS
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        before = _nearest(outline, lumens, index, middle, cornered)[1] == labels[last]
        low, high = np.where(before, middle, low), np.where(before, high, middle)
    changes = ((low + high) / 2).tolist()
    begun = labels[(last + 1) % _RAYS].tolist()
    return list(zip(begun, changes, [*changes[1:], changes[0] + 2 * math.pi]))


def _without_short_borders(diagram: Diagram, outline: Outline | BlendedOutline, lumens: list[Outline]) -> Diagram:
    """Shrink borders that are too short for elements to a vertex; the borders next to them are bent a little."""
    angle = np.linspace(0, 2 * math.pi, 64)
    walls = [float(outline.reach(a.x, a.y, angle).min()) - a.half_width for a in lumens]
    gaps = [math.hypot(a.x - b.x, a.y - b.y) - a.half_width - b.half_width for a, b in itertools.combinations(lumens, 2)]
    shortest = _SHORTEST * max(min(*walls, *gaps), 0.5 * min(lumen.half_width for lumen in lumens))
    place = np.arange(len(diagram.vertices))
    outer = {v for border in diagram.borders if border.other is None for v in border.ends}
    points = diagram.vertices.copy()
    short = []
    for number, border in enumerate(diagram.borders):
        length = np.hypot(*np.diff(border.points, axis=0).T).sum()
        a, b = (int(place[v]) for v in border.ends)
        if length >= shortest or a == b or len(diagram.loops[border.owner]) <= 3:
            continue
        if border.other is None and a in outer and b in outer and len({a, b}) == 2:
            continue  # a piece of the outline keeps its corners
        if border.other is not None and len(diagram.loops[border.other]) <= 3:
            continue
        # The outline's vertices stay where they are.
        keep, drop = (a, b) if a in outer or b not in outer else (b, a)
        if not (keep in outer or drop in outer):
            points[keep] = (points[a] + points[b]) / 2
        place[place == drop] = keep
        short.append(number)
    borders = []
    for border in diagram.borders:
        ends = int(place[border.ends[0]]), int(place[border.ends[1]])
        part = np.linspace(0.0, 1.0, len(border.points))[:, None]
        moved = border.points + (1 - part) * (points[ends[0]] - border.points[0]) + part * (points[ends[1]] - border.points[-1])
        borders.append(dataclasses.replace(border, ends=ends, points=moved))
    loops = [[(number, back) for number, back in loop if number not in short] for loop in diagram.loops]
    return Diagram(points, borders, loops)
