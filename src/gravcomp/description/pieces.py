"""The parts of which a row of segments consists: each of one material, with a section that changes linearly along it.

A segment is one piece, or one between each two of its stations; its cap is another. Where two neighbouring segments have
different sections a transition joins them, unless all sections of the robot are round and concentric: these may change in a step.
"""

import bisect
import dataclasses
import itertools
import math
from collections.abc import Sequence
from typing import Protocol, TypeVar

import numpy as np

from gravcomp.description.blended_outline import BlendedOutline, outline_between
from gravcomp.description.body import Material
from gravcomp.description.outline import Outline, encloses
from gravcomp.description.section_moments import SectionMoments, section_moments
from gravcomp.description.segment import Segment, require_room

_Placed = TypeVar("_Placed", bound="HasPlace")

# A transition whose length is not given: so many times as long as the outline moves in it, at least this part of the width.
_SLOPE, _PART = 2.0, 0.25
# In a layer of elements in a transition the areas of outline, wall and lumens change by about this factor at most.
_AREA_IN_LAYER = 1.5


class HasPlace(Protocol):
    """A part of the robot."""

    @property
    def start(self) -> float:
        """Arc length of its base (m)."""

    @property
    def length(self) -> float:
        """Its length (m)."""


@dataclasses.dataclass(frozen=True)
class Piece:
    """A part of one material, whose section changes linearly.

    segment: the name of its segment; kind: "transition", "cap" or nothing; start: arc length (m) of its base; length (m);
    outer: outlines at its base and its tip; lumens: the same for each lumen; marks: arc lengths (m) from its base, its ends not
    among them, where layers of elements must end; coils: outer and inner outline of the spring in whose place it is a tube.
    """

    segment: str
    kind: str
    start: float
    length: float
    outer: tuple[Outline, Outline]
    lumens: tuple[tuple[Outline, Outline], ...]
    material: Material
    marks: tuple[float, ...] = ()
    coils: tuple[Outline, Outline] | None = None

    @property
    def visible(self) -> "Piece":
        """The piece as it is seen and touched: of a spring the coils, not the tube in its place, which is wider."""
        if self.coils is None:
            return self
        outer, inner = self.coils
        return dataclasses.replace(self, outer=(outer, outer), lumens=((inner, inner),), coils=None)

    @property
    def name(self) -> str:
        """Its name in messages."""
        return f"{self.segment}, {self.kind}" if self.kind else self.segment

    @property
    def inner(self) -> tuple[Outline, Outline] | None:
        """The outlines of its only lumen; None where it has none."""
        return self.lumens[0] if self.lumens else None

    def section(self, s: float) -> tuple[Outline | BlendedOutline, tuple[Outline, ...]]:
        """Return the outline and the lumens at the arc length s (m) of the robot; beyond its ends those at its ends."""
        share = min(max((s - self.start) / self.length, 0.0), 1.0)
        lumens = tuple(outline_between(*lumen, share) for lumen in self.lumens)
        return outline_between(*self.outer, share), lumens  # type: ignore[return-value]  # lumens are ellipses, never blended

    def moments(self, s: float) -> SectionMoments:
        """Return area, centroid and second moments of the section there."""
        return section_moments(*self.section(s))


def piece_at(pieces: Sequence[_Placed], s: float) -> _Placed:
    """Return the piece at the arc length s (m), the later one where two meet."""
    ends = [piece.start + piece.length for piece in pieces[:-1]]
    return pieces[bisect.bisect_right(ends, s)]


def pieces_of_segments(segments: Sequence[Segment]) -> list[Piece]:
    """Return the pieces from base to tip.

    Raises ValueError for segments that do not touch, and for a transition that does not fit.
    """
    steps = all(_round_throughout(segment) for segment in segments)
    pieces: list[Piece] = []
    start = 0.0
    for segment in segments:
        first = 0.0
        if pieces:
            _check_joint(pieces[-1], segment)
            if segment.transition is not None or (not steps and _differ(pieces[-1], segment)):
                pieces.append(_transition(pieces[-1], segment, start))
                first = pieces[-1].length / segment.length
        for low, high in itertools.pairwise([first, *(part for part in segment.breaks if part > first + 1e-9), 1.0]):
            pieces.append(_piece(segment, start, low, high))
        start += segment.length
        if segment.cap:
            outer, lumens = segment.outline(1.0), segment.lumen_outlines(1.0)
            pairs = tuple((lumen, lumen) for lumen in lumens)
            cap, coils = segment.cap, segment.coils
            pieces.append(Piece(segment.name, "cap", start, cap.length, (outer, outer), pairs, cap.material, coils=coils))
            start += segment.cap.length
    return pieces


def _check_joint(before: Piece, segment: Segment) -> None:
    """Raise ValueError when a segment does not touch the piece before it, so that nothing holds it."""
    name = before.segment
    one, other = before.outer[1], segment.outline(0.0)
    holes = [(name, lumen[1], other) for lumen in before.lumens]
    holes += [(segment.name, lumen, one) for lumen in segment.lumen_outlines(0.0)]
    for holed, lumen, outline in holes:
        if encloses(lumen, outline, -1e-9):
            raise ValueError(
                f"segments '{name}' and '{segment.name}' do not touch: one fits into the other's lumen, {lumen} in '{holed}'"
            )


def _piece(segment: Segment, start: float, low: float, high: float) -> Piece:
    """The piece between two parts of a segment that begins at `start` (m)."""
    outer = segment.outline(low), segment.outline(high)
    lumens = tuple(zip(segment.lumen_outlines(low), segment.lumen_outlines(high)))
    start, length = start + low * segment.length, (high - low) * segment.length
    marks = _marks(segment, low, high)
    return Piece(segment.name, "", start, length, outer, lumens, segment.body_material, marks, segment.coils)


def _marks(segment: Segment, low: float, high: float) -> tuple[float, ...]:
    if segment.disks is None:
        return ()
    heights = np.array(segment.disks.heights(segment.length)) - low * segment.length
    slack = 1e-9 * segment.length
    return tuple(heights[(heights > slack) & (heights < (high - low) * segment.length - slack)].tolist())


def _round_throughout(segment: Segment) -> bool:
    outlines = [segment.outline(0.0), *segment.lumen_outlines(0.0)]
    return all(outline.round for outline in outlines) and len(outlines) <= 2


def _differ(before: Piece, segment: Segment) -> bool:
    """Whether the outlines differ where they meet, as many lumens lie elsewhere, or lumens that end touch others that begin."""
    ending, beginning = [pair[1] for pair in before.lumens], segment.lumen_outlines(0.0)
    if not before.outer[1].alike(segment.outline(0.0)):
        return True
    if len(ending) == len(beginning):
        return not all(one.alike(other) for one, other in zip(ending, beginning))
    others = [lumen for lumen in beginning if not any(lumen.alike(one) for one in ending)]
    try:
        require_room(before.outer[1], [*ending, *others])
    except ValueError:
        return True
    return False


def _transition_length(before: Outline, segment: Segment) -> float:
    """Twice as far as the outline moves, at least a part of its width, at most half of the segment."""
    angle = np.linspace(0.0, 2 * math.pi, 64, endpoint=False)
    moved = float(np.hypot(*(before.boundary(angle) - segment.outline(0.0).boundary(angle)).T).max())
    width = 2 * min(before.half_width, before.half_height)
    return min(max(_SLOPE * moved, _PART * width), segment.length / 2)


def _transition(before: Piece, segment: Segment, start: float) -> Piece:
    """The piece at the base of a segment in which its section develops from that of the piece before."""
    length = segment.transition
    if length is None:
        length = _transition_length(before.outer[1], segment)
    elif length >= segment.length * (1 - 1e-9):
        raise ValueError(
            f"segment '{segment.name}': transition_mm is {length * 1e3:g}; allowed: below its length, {segment.length * 1e3:g} mm"
        )
    part = length / segment.length
    base, tip = [pair[1] for pair in before.lumens], list(segment.lumen_outlines(part))
    if len(base) != len(tip):  # those that coincide go on, the others end
        own = segment.lumen_outlines(0.0)
        pairs = [(one, other) for one in base for before_taper, other in zip(own, tip) if one.alike(before_taper)]
        base, tip = [one for one, _ in pairs], [other for _, other in pairs]
    outer = before.outer[1], segment.outline(part)
    lumens = tuple(zip(base, tip))
    whole = [outline.area for outline in outer]
    wall = [area - sum(lumen[end].area for lumen in lumens) for end, area in enumerate(whole)]
    change = max(
        abs(math.log(tip_area / base_area)) for base_area, tip_area in (whole, wall, *((a.area, b.area) for a, b in lumens))
    )
    layers = math.ceil(change / math.log(_AREA_IN_LAYER))
    marks = {*_marks(segment, 0.0, part), *(length * k / layers for k in range(1, layers))}
    piece = Piece(
        segment.name, "transition", start, length, outer, lumens, segment.body_material, tuple(sorted(marks))
    )  # fmt: skip
    for share in np.linspace(0.0, 1.0, 9):
        try:
            require_room(*piece.section(start + float(share) * length))
        except ValueError as error:
            raise ValueError(
                f"between the segments '{before.segment}' and '{segment.name}' no channel fits: {error};"
                " lumens go on in the order in which they are listed"
            ) from error
    return piece
