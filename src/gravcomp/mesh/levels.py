"""Closed curves in the sections that bound the elements, one inside the other, and continued from base to tip.

A level is a curve in every section where a piece reaches across it. Every wall and every lumen is a level. Where a wide
piece meets a narrow one, the narrow one's wall goes on as a level inside the wide one, so that both share their nodes.
"""

import dataclasses
from collections.abc import Sequence

from gravcomp.description import BlendedOutline, Outline, Piece
from gravcomp.mesh.measured_outline import MeasuredOutline
from gravcomp.mesh.mesh import MeshError

Curve = Outline | BlendedOutline | MeasuredOutline

_SAME = 1e-9  # m


@dataclasses.dataclass
class Levels:
    """curves: for every level, from the innermost out, its outline in each plane between the pieces (None: not known there).

    spans: for every piece its innermost and outermost level; the innermost is -1 for a solid piece, which reaches to the axis.
    """

    curves: Sequence[Sequence[Curve | None]]
    spans: list[tuple[int, int]]

    @property
    def solid(self) -> bool:
        """Whether any piece reaches to the axis."""
        return any(low < 0 for low, _ in self.spans)


def levels_of(pieces: list[Piece]) -> Levels:
    """Return the levels of the pieces. Raises MeshError where neighbours' sections cannot share their nodes."""
    rounds = all(outline.round for piece in pieces for outline in (*piece.outer, *(piece.inner or ())))
    return _round_levels(pieces) if rounds else _equal_levels(pieces)


def _equal_levels(pieces: list[Piece]) -> Levels:
    """Levels of pieces whose sections are the same where they meet; a lumen may end there."""
    planes = len(pieces) + 1
    outer: list[Outline | None] = [None] * planes
    inner: list[Outline | None] = [None] * planes
    for index, piece in enumerate(pieces):
        for end in (0, 1):
            _require_same(pieces, index, outer, index + end, piece.outer[end], "outlines")
            if piece.inner:
                _require_same(pieces, index, inner, index + end, piece.inner[end], "lumens")
    if any(piece.inner for piece in pieces):
        known = [curve for curve in inner if curve is not None]
        for plane in range(planes):  # in a solid piece the neighbour's lumen goes on as a level
            if inner[plane] is None:
                inner[plane] = inner[plane - 1] if plane and inner[plane - 1] is not None else known[0]
        return Levels([inner, outer], [(0 if piece.inner else -1, 1) for piece in pieces])
    return Levels([outer], [(-1, 0)] * len(pieces))


def _require_same(pieces: list[Piece], index: int, curves: list[Outline | None], plane: int, outline: Outline, what: str) -> None:
    before = curves[plane]
    if before is not None and not before.alike(outline):
        raise MeshError(
            f"segments '{pieces[index - 1].name}' and '{pieces[index].name}' have different {what} where they meet"
            f" ({before}; {outline}): only round, concentric sections may change in a step"
        )
    curves[plane] = outline


def _round_levels(pieces: list[Piece]) -> Levels:
    """Levels of concentric round pieces, which may change in steps."""
    planes = len(pieces) + 1
    radii: list[list[float | None]] = []  # of every level, from the innermost out, in every plane
    spans: list[list[int]] = []

    def insert(position: int, plane: int, radius: float) -> None:
        """Make a level of `radius` in `plane`; in the planes where its neighbours are known it keeps its place between them."""
        row: list[float | None] = [None] * planes
        row[plane] = radius
        if 0 < position < len(radii):
            low, high = radii[position - 1], radii[position]
            inner, outer = low[plane], high[plane]
            if inner is not None and outer is not None:
                share = (radius - inner) / (outer - inner)
                for other in range(plane):
                    a, b = low[other], high[other]
                    row[other] = None if a is None or b is None else a + share * (b - a)
        radii.insert(position, row)
        for span in spans:
            for side in (0, 1):
                span[side] += span[side] >= position

    def level_at(plane: int, radius: float) -> int:
        """The level of this radius in the plane where the last piece ended; made where there is none."""
        low, high = spans[-1]
        for level in range(max(low, 0), high + 1):
            known = radii[level][plane]
            if known is not None and abs(known - radius) < _SAME:
                return level
        outermost = radii[high][plane]
        if outermost is not None and radius > outermost:
            if high + 1 == len(radii):
                insert(high + 1, plane, radius)
            radii[high + 1][plane] = radius
            return high + 1
        first = radii[max(low, 0)][plane]
        if first is not None and radius < first:
            if low > 0:
                radii[low - 1][plane] = radius
                return low - 1
            insert(0, plane, radius)
            # Inside a solid piece the new level lies below all others, at the same part of the next one.
            for other in range(plane):
                above = radii[1][other]
                if low < 0 and above is not None:
                    radii[0][other] = above * radius / first
            return 0
        position = next(k for k in range(max(low, 0), high + 1) if (radii[k][plane] or 0.0) > radius)
        insert(position, plane, radius)
        return position

    for index, piece in enumerate(pieces):
        outer = [outline.half_width for outline in piece.outer]
        inner = [outline.half_width for outline in piece.inner] if piece.inner else None
        if index == 0:
            for values in (inner, outer):
                if values:
                    radii.append([values[0]] + [None] * (planes - 1))
            span = [0 if inner else -1, len(radii) - 1]
        else:
            high = level_at(index, outer[0])
            count = len(radii)
            low = level_at(index, inner[0]) if inner else -1
            span = [low, high + (len(radii) - count if 0 <= low <= high else 0)]
        spans.append(span)
        _continue(radii, index, span, inner[1] if inner else 0.0, outer[1])
    curves = [[None if r is None else Outline.circle(2 * r) for r in row] for row in radii]
    return Levels(curves, [(low, high) for low, high in spans])


def _continue(radii: list[list[float | None]], plane: int, span: list[int], inner: float, outer: float) -> None:
    """Give the levels of a piece between its walls their radii at its end: at the same part of the wall as at its base."""
    low, high = span
    start = 0.0 if low < 0 else radii[low][plane]
    end = radii[high][plane]
    assert start is not None and end is not None  # both walls are known at the base
    for level in range(max(low, 0), high + 1):
        here = radii[level][plane]
        if here is None:  # a level of earlier pieces that this one reaches across again
            below = radii[level - 1][plane] if level else 0.0
            above = next(r for r in (row[plane] for row in radii[level:]) if r is not None)
            here = radii[level][plane] = ((below or 0.0) + above) / 2
        radii[level][plane + 1] = inner + (here - start) / (end - start) * (outer - inner)
