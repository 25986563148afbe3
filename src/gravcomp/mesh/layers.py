"""Heights at which the layers of elements end, shorter toward the clamp, whose corner is singular, and where the body is soft."""

import itertools
from collections.abc import Sequence
from typing import Protocol

import numpy as np

from gravcomp.description import Material, SectionMoments
from gravcomp.description.pieces import HasPlace, piece_at
from gravcomp.mesh.mesh import MeshError

# Places at which the stiffness of sections is asked for, and how many times denser than at the stiffest one layers may be.
_SAMPLES, _DENSEST = 100, 8.0


class LayeredPiece(HasPlace, Protocol):
    """A part of one material that layers of elements divide, as `description.Piece` is."""

    @property
    def material(self) -> Material:
        """Its material."""

    @property
    def marks(self) -> tuple[float, ...]:
        """Arc lengths (m) from its base, its ends not among them, where layers must end."""

    def moments(self, s: float) -> SectionMoments:
        """Return area, centroid and second moments of the section at the arc length s (m) of the robot."""


def least_layers(pieces: Sequence[LayeredPiece]) -> int:
    """Return the number of parts, each a layer or more, into which the ends of the pieces and their marks divide the robot."""
    return sum(len(piece.marks) + 1 for piece in pieces)


def layers_of(
    pieces: Sequence[LayeredPiece], along: int, grading: float, first: float | None = None, softness: float = 0.0
) -> tuple[np.ndarray, list[int]]:
    """Return heights (along + 1,) in m in geometric progression, and the piece of each layer.

    first: thickness (m) of the first layer; the next ones are twice as thick as the one before, up to an even thickness.
    softness: the layers are denser by this power of how much softer in bending a section is than the stiffest one. They are moved
    so that the ends of the pieces and their marks are among them. Raises MeshError when `along` is too small.
    """
    lengths, owner = [], []
    for index, piece in enumerate(pieces):
        parts = np.diff([0.0, *piece.marks, piece.length])
        lengths += parts.tolist()
        owner += [index] * len(parts)
    if along < len(lengths):
        marked = any(piece.marks for piece in pieces)
        has = f"{len(lengths)} distances between disks and ends of segments" if marked else f"{len(lengths)} tubes and caps"
        raise MeshError(f"elements.along is {along}; the robot has {has}: at least that many are needed")
    ends = np.concatenate([[0.0], np.cumsum(lengths)])
    even, moved = _denser_where_soft(pieces, softness) if softness else (ends[[0, -1]], ends[[0, -1]])
    if first is None:
        sizes = grading ** (np.arange(along) / max(along - 1, 1))
    else:
        sizes = _growing(first * (even[1] - even[0]) / (moved[1] - moved[0]), ends[-1], along)
    ideal = np.interp(np.concatenate([[0.0], np.cumsum(sizes) / sizes.sum()]) * ends[-1], even, moved)
    index_of = [0]
    for part in range(1, len(lengths)):
        nearest = int(np.argmin(np.abs(ideal - ends[part])))
        index_of.append(min(max(nearest, index_of[-1] + 1), along - (len(lengths) - part)))
    index_of.append(along)
    heights = np.interp(ideal, ideal[index_of], ends)
    return heights, [owner[part] for part, (a, b) in enumerate(itertools.pairwise(index_of)) for _ in range(b - a)]


def _growing(first: float, length: float, along: int) -> np.ndarray:
    """Thicknesses (along,) in m of layers that double from `first` (m) up to an even thickness, in half of the layers at most."""
    if first >= length / along:
        return np.ones(along)
    for count in range(1, max(along // 2, 1) + 1):
        growing = first * 2.0 ** np.arange(count)
        rest = (length - growing.sum()) / max(along - count, 1)
        if rest <= 2.0 * growing[-1]:
            break
    return np.concatenate([growing, np.full(along - count, rest)])


def softest(pieces: Sequence[LayeredPiece]) -> float:
    """Return the smallest stiffness in bending of a section over the largest."""
    stiffness = _stiffness(pieces, _places(pieces))
    return float(stiffness.min() / stiffness.max())


def _denser_where_soft(pieces: Sequence[LayeredPiece], softness: float) -> tuple[np.ndarray, np.ndarray]:
    """The heights (s + 1,) in m as even layers have them, and where they go so that layers are denser where a section is soft."""
    heights = _places(pieces)
    stiffness = _stiffness(pieces, heights)
    density = np.minimum((stiffness.max() / stiffness) ** softness, _DENSEST)
    reached = np.concatenate([[0.0], np.cumsum(density)])
    return reached / reached[-1] * heights[-1], heights


def _places(pieces: Sequence[LayeredPiece]) -> np.ndarray:
    """Evenly spaced heights (s + 1,) in m between which the stiffness is asked for."""
    return np.linspace(0.0, pieces[-1].start + pieces[-1].length, _SAMPLES + 1)


def _stiffness(pieces: Sequence[LayeredPiece], heights: np.ndarray) -> np.ndarray:
    """The mean stiffness in bending (s,) in N m^2 half way between the heights (s + 1,) in m."""
    found = []
    for height in 0.5 * (heights[1:] + heights[:-1]):
        piece = piece_at(pieces, height)
        moments = piece.moments(height)
        found.append(piece.material.axial_modulus * 0.5 * (moments.xx + moments.yy))
    return np.array(found)
