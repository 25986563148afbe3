"""Faces of a closed surface in groups that do not meet in hollow edges or hollow corners.

A section of the robot that lies in a hollow edge, such as those between the facets of a lumen from a file, touches both faces;
one that lies in a hollow corner touches faces that have no edge in common. An obstacle is touched at one place of each section;
so faces that meet there are made different rows of the obstacle, as the walls of a hollow cuboid are. In one row the place would
change from one face to the other with every step, and no equilibrium would be found. Elsewhere neighbours stay together: at an
edge that stands out the robot touches one place.
"""

import collections
import itertools

import numpy as np

_FLAT = 1e-3  # sine of the angle between two faces up to which their edge is none


def face_groups(nodes: np.ndarray, faces: np.ndarray, sign: float) -> list[np.ndarray]:
    """Return the indices of the faces of each group; one where no edge and no corner is hollow.

    nodes (n, 3); faces (f, 3) of a closed surface, facing outward; sign: 1 where the robot is outside, -1 inside. Faces are
    coloured one after the other along edges that are not hollow, each like its neighbours if nothing hollow forbids it.
    """
    apart = _apart(nodes, faces, sign)
    if not any(apart):
        return [np.arange(len(faces))]
    beyond, group = _neighbours(faces), np.full(len(faces), -1)
    for seed in range(len(faces)):
        waiting = collections.deque([seed])
        while waiting:
            face = waiting.popleft()
            if group[face] >= 0:
                continue
            forbidden = {group[other] for other in apart[face]}
            others = [other for other in beyond[face] if other not in apart[face]]
            alike = [group[other] for other in others if group[other] >= 0 and group[other] not in forbidden]
            group[face] = alike[0] if alike else next(g for g in itertools.count() if g not in forbidden)
            waiting.extendleft(others)
            waiting.extend(other for other in beyond[face] if other in apart[face])
    return [np.flatnonzero(group == g) for g in range(group.max() + 1)]


def _neighbours(faces: np.ndarray) -> np.ndarray:
    """Return the faces (f, 3) across the edges 01, 12 and 20 of each face."""
    edges = np.sort(faces[:, [(0, 1), (1, 2), (2, 0)]].reshape(-1, 2), axis=1)
    order = np.lexsort(edges.T)  # a closed surface has every edge twice
    one, other = order[0::2], order[1::2]
    beyond = np.empty(len(edges), dtype=np.int64)
    beyond[one], beyond[other] = other // 3, one // 3
    return beyond.reshape(-1, 3)


def _apart(nodes: np.ndarray, faces: np.ndarray, sign: float) -> list[set[int]]:
    """Return for each face those with which it has a corner in common and meets there in a hollow.

    Two faces do where a part of each is on the robot's side of the other one's plane: then a section can touch both.
    """
    one, other = _sharing_a_corner(faces)
    corners = nodes[faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    unit = across / np.linalg.norm(across, axis=1, keepdims=True)
    size = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)

    def rises(face: np.ndarray, over: np.ndarray) -> np.ndarray:
        height = sign * ((corners[face] - corners[over, :1]) * unit[over, None]).sum(axis=2)
        return np.asarray(height.max(axis=1) > _FLAT * size[face])

    bent = np.linalg.norm(np.cross(unit[one], unit[other]), axis=1) > _FLAT
    hollow = bent & rises(other, one) & rises(one, other)
    apart: list[set[int]] = [set() for _ in faces]
    for face, beyond in zip(one[hollow].tolist(), other[hollow].tolist()):
        apart[face].add(beyond)
        apart[beyond].add(face)
    return apart


def _sharing_a_corner(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return both faces (p,) of each pair that has a corner in common, the one with the lower number first."""
    from scipy.sparse import csr_matrix

    at = csr_matrix((np.ones(faces.size), (np.repeat(np.arange(len(faces)), 3), faces.ravel())))
    pairs = (at @ at.T).tocoo()
    once = pairs.row < pairs.col
    return pairs.row[once], pairs.col[once]
