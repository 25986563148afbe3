"""The shape of a segment at rest, without load."""

import dataclasses

from gravcomp.config import parameter


@dataclasses.dataclass(frozen=True)
class RestShape:
    """A circular arc. The cap of the segment stays straight; the next segment goes on where this one ends."""

    bend_angle: float = parameter(edge="deg", minimum=-360.0, maximum=360.0, description="angle between both ends of the segment")
    bend_plane: float = parameter(
        0.0, edge="deg", minimum=-360.0, maximum=360.0, description="direction that it bends towards, about z from x"
    )
