"""The body as stretches between marks along its axis, each of one material: what the rod is made of.

Segments, transitions and caps give their sections from outline and lumens. A body from a file is cut across its axis: the section
constants are those of its surface there.
"""

from dataclasses import dataclass

from gravcomp.description import Material, MeshBody, Piece, Robot
from gravcomp.virtual.cross_section import CrossSection, cross_section
from gravcomp.virtual.sliced_body import slice_of


@dataclass(frozen=True)
class Stretch:
    """A piece of the segments, or the body from a file, from the arc length `start` on; both in m.

    index: of its segment, by which material classes and drawn values are found.
    """

    index: int
    start: float
    length: float
    material: Material
    source: Piece | MeshBody

    def section(self, s: float) -> CrossSection:
        """Return the constants of the section at the arc length s (m). Raises ConfigError where a file's body has none."""
        if isinstance(self.source, MeshBody):
            return slice_of(self.source, (s - self.start) / self.length)
        return cross_section(*self.source.section(s))


def stretch_at(stretches: list[Stretch], s: float) -> Stretch:
    """Return the stretch at the arc length s (m); beyond the tip the last one."""
    return next((stretch for stretch in stretches if s < stretch.start + stretch.length), stretches[-1])


def stretches_of(robot: Robot) -> list[Stretch]:
    """Return the stretches from base to tip."""
    if robot.body is not None:
        return [Stretch(0, 0.0, robot.length, robot.body.material, robot.body)]
    index = {segment.name: number for number, segment in enumerate(robot.segments)}
    return [Stretch(index[piece.segment], piece.start, piece.length, piece.material, piece) for piece in robot.pieces]
