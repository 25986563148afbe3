"""Division of the cross-sections of a row of pieces into quadrilaterals."""

import functools
from collections.abc import Sequence

import numpy as np

from gravcomp.description import BlendedOutline, Outline, Piece
from gravcomp.mesh.channels import Channel, channels_of
from gravcomp.mesh.levels import Levels, levels_of
from gravcomp.mesh.lumen_grid import lumen_grid
from gravcomp.mesh.section_grid import SectionGrid, section_grid


def divided_sections(pieces: Sequence[Piece], around: int, radial: int, equal_stiffness: bool = False) -> SectionGrid:
    """Divide the sections: `around` cells about the axis, or each lumen where there are several, and `radial` through walls.

    equal_stiffness: see `section_grid`; without effect on sections with several lumens. The arrays of the result are those of
    other meshes of the same sections, and not to be changed. Raises MeshError where the sections of neighbours cannot share
    their nodes.
    """
    return _divided(tuple(pieces), around, radial, equal_stiffness)


@functools.lru_cache(maxsize=16)
def _divided(pieces: tuple[Piece, ...], around: int, radial: int, equal_stiffness: bool) -> SectionGrid:
    """Do as `divided_sections`. A search for a mesh changes the numbers along the robot more often than those of the section."""
    if any(len(piece.lumens) > 1 for piece in pieces):
        outlines, channels = channels_of(list(pieces))
        return lumen_grid(outlines, channels, around, radial)
    return section_grid(levels_of(list(pieces)), around, radial, equal_stiffness)


def divided_section(
    outline: Outline | BlendedOutline, lumens: Sequence[Outline], around: int, radial: int
) -> tuple[np.ndarray, np.ndarray]:
    """Divide a single section. Returns cells (k, 3, 3) and the places (n, 2) of the nodes in m. Raises MeshError."""
    if len(lumens) > 1:
        # A section is the piece of no length between two equal planes.
        channels = [Channel([lumen, lumen], np.array([True])) for lumen in lumens]
        grid = lumen_grid([outline, outline], channels, around, radial)
    else:
        curves: list[list[Outline | BlendedOutline | None]] = [[lumen] for lumen in lumens]
        curves.append([outline])
        grid = section_grid(Levels(curves, [(0 if lumens else -1, len(lumens))]), around, radial)
    return grid.cells, grid.place[0]
