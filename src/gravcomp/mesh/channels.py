"""Channels: lumens that are continued from piece to piece, and filled with material where no lumen is."""

import dataclasses

import numpy as np

from gravcomp.description import Outline, Piece
from gravcomp.description.segment import require_room
from gravcomp.mesh.mesh import MeshError

# A filled circle that touches a lumen shrinks to this part of the room that it has.
_PART_OF_ROOM = 0.6


@dataclasses.dataclass
class Channel:
    """circles: its outline in each plane between the pieces; open (pieces,): whether it is a lumen there, else it is filled."""

    circles: list[Outline]
    open: np.ndarray


def channels_of(pieces: list[Piece]) -> tuple[list[Outline], list[Channel]]:
    """Return the outline of the body in each plane between the pieces, and the channels.

    Where a channel is filled it keeps its place relative to the outline. Raises MeshError where neighbours' outlines differ,
    and where channels overlap.
    """
    outlines = [pieces[0].outer[0], *(piece.outer[1] for piece in pieces)]
    found: list[tuple[dict[int, Outline], np.ndarray]] = []
    for index, piece in enumerate(pieces):
        if not piece.outer[0].alike(outlines[index]):
            raise MeshError(
                f"segments '{pieces[index - 1].name}' and '{piece.name}' have different outlines where they meet"
                f" ({outlines[index]}; {piece.outer[0]}): give the second one transition_mm"
            )
        for base, tip in piece.lumens:
            known = next((c for c in found if index in c[0] and c[0][index].alike(base)), None)
            if known is None:
                known = {index: base}, np.zeros(len(pieces), dtype=bool)
                found.append(known)
            known[0][index + 1] = tip
            known[1][index] = True
    channels = [
        Channel([_continued(circles, outlines, plane) for plane in range(len(outlines))], is_open) for circles, is_open in found
    ]
    for plane, outline in enumerate(outlines):
        _make_room(channels, plane, outline, pieces[min(plane, len(pieces) - 1)].name)
    return outlines, channels


def _make_room(channels: list[Channel], plane: int, outline: Outline, name: str) -> None:
    """Shrink the filled circles of a plane that touch others. Raises MeshError where walls of lumens do, or none is left."""
    placed: list[Outline] = []
    for channel in sorted(channels, key=lambda channel: not _is_wall(channel, plane)):
        circle = channel.circles[plane]
        try:
            require_room(outline, [*placed, circle])
        except ValueError as error:
            room = float(outline.reach(circle.x, circle.y, np.linspace(0.0, 2 * np.pi, 48)).min())
            room = min([room, *(np.hypot(circle.x - p.x, circle.y - p.y) - p.half_width for p in placed)])
            if _is_wall(channel, plane) or outline.gauge(circle.x, circle.y) >= 1.0 or room < 0.05 * outline.half_width:
                raise MeshError(
                    f"at the base of '{name}': {error}. Lumens that end and others that begin must lie apart from each other"
                ) from error
            circle = Outline.circle(2 * _PART_OF_ROOM * room, circle.x, circle.y)
        channel.circles[plane] = circle
        placed.append(circle)


def _is_wall(channel: Channel, plane: int) -> bool:
    """Whether the circle in the plane bounds a lumen of one of its neighbours."""
    return bool(channel.open[max(plane - 1, 0) : plane + 1].any())


def _continued(circles: dict[int, Outline], outlines: list[Outline], plane: int) -> Outline:
    """The circle in a plane: the one known there, or the one in the nearest plane, at the same part of the outline."""
    if plane in circles:
        return circles[plane]
    nearest = min(circles, key=lambda known: abs(known - plane))
    known, before, here = circles[nearest], outlines[nearest], outlines[plane]
    across, up = here.half_width / before.half_width, here.half_height / before.half_height
    return Outline.circle((across + up) * known.half_width, across * known.x, up * known.y)
