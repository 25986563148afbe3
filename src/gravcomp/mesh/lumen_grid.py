"""Division of sections with several lumens into quadrilaterals, the same from base to tip.

In one plane a region around each lumen (`lumen_cells`) is divided into sectors and rings. In the other planes the nodes keep
their parameters on the walls, and those between are displaced as a harmonic function, which a uniform taper reproduces exactly.
Where a channel is filled, a ring lies in it and a square of cells or kites inside the ring.
"""

import itertools
import math
from collections.abc import Sequence

import numpy as np
from scipy.sparse.linalg import spsolve

from gravcomp.description import BlendedOutline, Outline
from gravcomp.mesh.channels import Channel
from gravcomp.mesh.lumen_cells import Diagram, diagram_of
from gravcomp.mesh.mesh import MeshError
from gravcomp.mesh.section_grid import BULGE, EVEN, SectionGrid, core_cells
from gravcomp.mesh.section_laplace import jacobian_ratios, stiffness_and_moments

# A division whose worst cell has a smaller Jacobian ratio is tried again from another plane, and with up to so many filled
# channels more: where there is much room between the lumens, they make the cells around it regular.
_GOOD, _MOST_FILLINGS = 0.25, 3
# What a more complicated division has to gain.
_BETTER = 0.03
# What fills a channel inside the ring reaches to this part of its radius.
_FILLED = 0.6
# Up to so many sectors a channel is filled with kites: more of them would be too obtuse.
_MOST_KITES = 10


def lumen_grid(outlines: Sequence[Outline | BlendedOutline], channels: list[Channel], around: int, radial: int) -> SectionGrid:
    """Divide the sections with these outlines, one in each plane, and channels.

    About `around` cells lie about each channel, and `radial` through the wall around it.
    Raises MeshError where the sections differ too much.
    """
    best: tuple[float, SectionGrid] | None = None
    for fillings, reference in itertools.product(range(_MOST_FILLINGS + 1), _distinct(outlines, channels)):
        grid = _divided_in(outlines, channels, reference, around, radial, fillings)
        worst = min(float(jacobian_ratios(grid.cells, place).min()) for place in grid.place)
        if best is None or worst > best[0] + _BETTER:
            best = worst, grid
        if best[0] > _GOOD:
            break
    assert best is not None  # the loop has run
    if best[0] <= 0.0:
        raise MeshError(
            "the lumens of neighbouring segments are too different for one division of their sections: let those that go on"
            " coincide where the segments meet, and the others lie farther apart"
        )
    return best[1]


def _divided_in(
    outlines: Sequence[Outline | BlendedOutline], channels: list[Channel], reference: int, around: int, radial: int, fillings: int
) -> SectionGrid:
    """The division found in the plane `reference` and continued to the others, with so many filled channels more."""
    outline, lumens = outlines[reference], [channel.circles[reference] for channel in channels]
    filled = [not channel.open.all() for channel in channels] + [True] * fillings
    for _ in range(fillings):
        lumens.append(_roomiest(outline, lumens))
    diagram = diagram_of(outline, lumens, any(o.shape != "ellipse" for o in outlines))
    division = _Division(outline, lumens, diagram, _numbers(diagram, around, filled), radial, filled)
    present = np.ones((len(channels[0].open), len(division.cells)), dtype=bool)
    for index, of in enumerate(division.filling_of):
        if 0 <= of < len(channels):
            present[:, index] = ~channels[of].open
    return SectionGrid(division.cells, present, _in_planes(division, outlines, channels, reference))


def _distinct(outlines: Sequence[Outline | BlendedOutline], channels: list[Channel]) -> list[int]:
    """The planes whose sections are not uniformly scaled ones of earlier planes."""
    known: dict[tuple, int] = {}
    for plane, outline in enumerate(outlines):
        sizes = [
            outline.half_height,
            *(v for c in channels for v in (c.circles[plane].half_width, c.circles[plane].x, c.circles[plane].y)),
        ]
        known.setdefault((outline.shape, *(round(size / outline.half_width, 6) for size in sizes)), plane)
    return list(known.values())


def _roomiest(outline: Outline | BlendedOutline, lumens: list[Outline]) -> Outline:
    """The circle in the middle of the widest part of the section between the lumens, half as wide as it."""
    part = np.linspace(-1.0, 1.0, 41)
    x, y = (g.ravel() for g in np.meshgrid(outline.x + part * outline.half_width, outline.y + part * outline.half_height))
    inside = np.array([outline.gauge(a, b) < 0.95 for a, b in zip(x, y)])
    x, y = x[inside], y[inside]
    border = outline.boundary(np.linspace(0.0, 2 * math.pi, 200))
    room = np.hypot(x[:, None] - border[:, 0], y[:, None] - border[:, 1]).min(axis=1)
    for lumen in lumens:
        room = np.minimum(room, np.hypot(x - lumen.x, y - lumen.y) - lumen.half_width)
    widest = int(np.argmax(room))
    return Outline.circle(float(room[widest]), float(x[widest]), float(y[widest]))


def _numbers(diagram: Diagram, around: int, filled: list[bool]) -> list[int]:
    """How many cells lie along each border; around a filled channel their number suits its filling."""
    number = [max(1, math.ceil(border.angle * around / (2 * math.pi) - 0.3)) for border in diagram.borders]
    # A region without an outer border gives cells to a neighbour, which has one or comes later.
    depth = [0 if any(diagram.borders[b].other is None for b, _ in loop) else 1 for loop in diagram.loops]
    for index in sorted(range(len(depth)), key=lambda i: -depth[i]):
        loop = [b for b, _ in diagram.loops[index]]
        while filled[index] and not _can_be_filled(sum(number[b] for b in loop)):
            widest = max(loop, key=lambda b: (diagram.borders[b].other is None, diagram.borders[b].angle / number[b]))
            number[widest] += 1
    if any(f and sum(number[b] for b, _ in loop) % 2 for f, loop in zip(filled, diagram.loops)):
        number = [2 * n for n in number]
    return number


def _can_be_filled(sectors: int) -> bool:
    """Whether a channel of so many sectors can be filled with cells of a good shape."""
    return sectors % 4 == 0 or (sectors % 2 == 0 and sectors <= _MOST_KITES)


class _Division:
    """Nodes and cells in the plane of the diagram.

    place (n, 2); cells (k, 3, 3); filling_of: for every cell the channel that it fills, else -1; on_outline: nodes on the
    outline; on_lumen: those on each lumen's wall.
    """

    def __init__(
        self, outline: Outline | BlendedOutline, lumens: list[Outline], diagram: Diagram, number: list[int], radial: int,
        filled: list[bool],
    ):  # fmt: skip
        self._points: list[np.ndarray] = [*diagram.vertices]
        self._cells: list[np.ndarray] = []
        self.filling_of: list[int] = []
        self.on_outline: set[int] = set()
        self.on_lumen: list[list[int]] = []
        rows = []
        for border, count in zip(diagram.borders, number):
            inner = _evenly(border.points, 2 * count)[1:-1]
            if border.other is None:
                inner = _onto(outline, inner)
            row = [border.ends[0], *self._add(inner), border.ends[1]]
            rows.append(row)
            if border.other is None:
                self.on_outline.update(row)
        for index, (lumen, loop) in enumerate(zip(lumens, diagram.loops)):
            around = [node for b, back in loop for node in (rows[b][::-1] if back else rows[b])[:-1]]
            self._surround(lumen, around, radial)
            if filled[index]:
                self._fill(lumen, self.on_lumen[index], index)
        self.place, self.cells = np.array(self._points), np.array(self._cells)

    def _add(self, points: np.ndarray) -> list[int]:
        first = len(self._points)
        self._points.extend(points)
        return list(range(first, len(self._points)))

    def _surround(self, lumen: Outline, around: list[int], radial: int) -> None:
        """Cells between a lumen and the border of its region, whose nodes are `around` it."""
        border = np.array([self._points[node] for node in around])
        middle = np.array([lumen.x, lumen.y])
        wall = _wall(lumen, border)
        share = _shares(lumen.half_width / np.hypot(*(border - middle).T).mean(), radial)
        rings = [self._add(wall)]
        rings += [self._add(wall + part * (border - wall)) for part in share[1:-1]]
        rings.append(around)
        self.on_lumen.append(rings[0])
        self._ring_cells(rings, -1)

    def _fill(self, lumen: Outline, wall: list[int], channel: int) -> None:
        """Cells inside a channel: a ring, and inside it a square of cells, or kites where the sectors are no multiple of 4."""
        middle = np.array([lumen.x, lumen.y])
        outer = np.array([self._points[node] for node in wall])
        count = len(wall)
        corner = _FILLED * (outer - middle)
        sides = 2 if count % 8 else count // 4
        # Sides that are nearly straight, so that two neighbouring ones meet at an angle.
        part = (np.arange(count) % sides / sides)[:, None]
        first = np.arange(count) // sides * sides
        straight = (1.0 - part) * corner[first] + part * corner[(first + sides) % count]
        side = middle + (straight if sides == 2 else (1.0 - BULGE) * straight + BULGE * corner)
        rings = [self._add(side), self._add((side + outer) / 2), wall]
        self._ring_cells(rings, channel)
        if count % 8:
            self._kites(middle, side, rings[0], channel)
            return
        cells, inner = core_cells(count // 8, side[None], count)
        number = np.array([*rings[0], *self._add(inner[0])])
        self._cells.extend(number[cells])
        self.filling_of += [channel] * len(cells)

    def _kites(self, middle: np.ndarray, side: np.ndarray, ring: list[int], channel: int) -> None:
        """Cells between the middle of a channel and three corners each of the polygon `side` (k, 2), whose nodes are `ring`."""
        count = len(ring)
        centre = self._add(middle[None])[0]
        spokes = {k: self._add(((middle + side[k]) / 2)[None])[0] for k in range(0, count, 4)}
        for k in range(0, count, 4):
            right, tip, left = k, (k + 2) % count, (k + 4) % count
            inside = self._add(((middle + side[right] + side[tip] + side[left]) / 4)[None])[0]
            self._cells.append(np.array([
                [centre, spokes[left], ring[left]],
                [spokes[right], inside, ring[(k + 3) % count]],
                [ring[right], ring[(k + 1) % count], ring[tip]],
            ]))  # fmt: skip
            self.filling_of.append(channel)

    def _ring_cells(self, rings: list[list[int]], channel: int) -> None:
        """Cells between rings of nodes, given on half steps in both directions."""
        table = np.array(rings)
        count = table.shape[1]
        for ring in range(0, len(table) - 2, 2):
            for sector in range(0, count, 2):
                self._cells.append(table[ring : ring + 3][:, [sector, sector + 1, (sector + 2) % count]])
                self.filling_of.append(channel)


def _shares(ratio: float, radial: int) -> np.ndarray:
    """(2 radial + 1,) parts of the way from a lumen to its region's border at which nodes lie, on half steps."""
    part = np.arange(radial + 1) / radial
    whole = part if ratio > EVEN else ((1.0 / ratio) ** part - 1.0) / (1.0 / ratio - 1.0)
    return np.interp(np.arange(2 * radial + 1) / 2, np.arange(radial + 1), whole)


def _wall(lumen: Outline, border: np.ndarray) -> np.ndarray:
    """(k, 2) nodes of a lumen's wall that belong to those of its region's border (k, 2).

    They lie between the directions of the border's nodes as seen from the lumen and from the middle of its region, and even
    distances: where the cells are least skewed.
    """
    middle, corner = np.array([lumen.x, lumen.y]), border[::2]
    seen, spread = (np.arctan2(*(corner - centre).T[::-1]) for centre in (middle, corner.mean(axis=0)))
    even = seen[0] + 2 * math.pi * np.arange(len(corner)) / len(corner)
    even = even + np.mod(seen - even + math.pi, 2 * math.pi).mean() - math.pi
    best, result = -np.inf, border
    for towards, part in [(spread, p) for p in (0.0, 0.3, 0.6, 0.9)] + [(even, p) for p in (0.3, 0.6, 0.9)]:
        mean = seen + part * (np.mod(towards - seen + math.pi, 2 * math.pi) - math.pi)
        after = mean + np.mod(np.roll(mean, -1) - mean, 2 * math.pi)
        both = np.stack([mean, (mean + after) / 2], axis=1).ravel()
        wall = middle + lumen.half_width * np.stack([np.cos(both), np.sin(both)], axis=1)
        worst = _worst_corner(wall[::2], corner)
        if worst > best:
            best, result = worst, wall
    return result


def _worst_corner(wall: np.ndarray, border: np.ndarray) -> float:
    """The smallest over the largest Jacobian at the corners of the quadrilaterals between two closed lines (k, 2)."""
    corners = np.stack([wall, border, np.roll(border, -1, axis=0), np.roll(wall, -1, axis=0)], axis=1)
    ahead, back = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    cross = ahead[..., 0] * back[..., 1] - ahead[..., 1] * back[..., 0]
    return float((cross.min(axis=1) / cross.max(axis=1)).min())


def _evenly(line: np.ndarray, count: int) -> np.ndarray:
    """(count + 1, 2) points at equal distances along a polyline."""
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    at = np.linspace(0.0, along[-1], count + 1)
    return np.stack([np.interp(at, along, line[:, i]) for i in range(2)], axis=1)


def _onto(outline: Outline | BlendedOutline, points: np.ndarray) -> np.ndarray:
    """The points (k, 2) moved onto the outline along the ray from its middle."""
    gauge = np.array([outline.gauge(x, y) for x, y in points])[:, None] if len(points) else np.ones((0, 1))
    middle = np.array([outline.x, outline.y])
    return middle + (points - middle) / gauge


def _in_planes(
    division: _Division, outlines: Sequence[Outline | BlendedOutline], channels: list[Channel], reference: int
) -> np.ndarray:
    """(planes, n, 2) the nodes in every plane, from those in the reference plane, scaled with the outline and then displaced."""
    place, before = division.place, outlines[reference]
    outer = np.array(sorted(division.on_outline))
    matrix = stiffness_and_moments(division.cells, place, equal=True)[0]
    planes: list[np.ndarray] = []
    for outline in outlines:
        plane = len(planes)
        scaled = place * [outline.half_width / before.half_width, outline.half_height / before.half_height]
        moved, fixed = scaled.copy(), [outer]
        moved[outer] = outline.boundary(before.parameter(*place[outer].T))
        for channel, nodes in zip(channels, division.on_lumen):
            then, here = channel.circles[reference], channel.circles[plane]
            directions = (place[nodes] - [then.x, then.y]) / then.half_width
            moved[nodes] = np.array([here.x, here.y]) + here.half_width * directions
            fixed.append(np.array(nodes))
        known = np.concatenate(fixed)
        change = moved - scaled
        if np.abs(change).max() > 1e-12:
            free = np.setdiff1d(division.cells, known)
            moved[free] += spsolve(matrix[free][:, free], -(matrix[free][:, known] @ change[known]))
        planes.append(moved)
    return np.array(planes)
