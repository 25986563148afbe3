"""Heights at which the layers of elements end, shorter toward the clamp, whose corner is singular."""

import itertools

import numpy as np

from gravcomp.description import Piece
from gravcomp.mesh.mesh import MeshError


def least_layers(pieces: list[Piece]) -> int:
    """Return the number of parts, each a layer or more, into which the ends of the pieces and their marks divide the robot."""
    return sum(len(piece.marks) + 1 for piece in pieces)


def layers_of(pieces: list[Piece], along: int, grading: float) -> tuple[np.ndarray, list[int]]:
    """Return heights (along + 1,) in geometric progression, and the piece of each layer.

    They are moved so that the ends of the pieces and their marks are among them. Raises MeshError when `along` is too small.
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
    sizes = grading ** (np.arange(along) / max(along - 1, 1))
    ideal = np.concatenate([[0.0], np.cumsum(sizes) / sizes.sum()]) * ends[-1]
    index_of = [0]
    for part in range(1, len(lengths)):
        nearest = int(np.argmin(np.abs(ideal - ends[part])))
        index_of.append(min(max(nearest, index_of[-1] + 1), along - (len(lengths) - part)))
    index_of.append(along)
    heights = np.interp(ideal, ideal[index_of], ends)
    return heights, [owner[part] for part, (a, b) in enumerate(itertools.pairwise(index_of)) for _ in range(b - a)]
