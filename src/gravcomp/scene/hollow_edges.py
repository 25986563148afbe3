"""Faces of a closed surface in groups that do not meet in hollow edges.

A section of the robot that lies in a hollow edge, such as those between the facets of a lumen from a file, touches both faces. An
obstacle is touched at one place of each section; so faces that meet in a hollow edge are made different rows of the obstacle, as
the walls of a hollow cuboid are. Elsewhere neighbours stay together: at an edge that stands out the robot touches one place.
"""

import collections

import numpy as np

_FLAT = 1e-3  # sine of the angle between two faces up to which their edge is none


def face_groups(nodes: np.ndarray, faces: np.ndarray, sign: float) -> list[np.ndarray]:
    """Return the indices of the faces of each group, at most four groups; one where no edge is hollow.

    nodes (n, 3); faces (f, 3) of a closed surface, facing outward; sign: 1 where the robot is outside, -1 inside. Faces are
    coloured one after the other along edges that are not hollow, each like its neighbours if no hollow edge forbids it.
    """
    beyond, hollow = _neighbours(nodes, faces, sign)
    if not hollow.any():
        return [np.arange(len(faces))]
    group = np.full(len(faces), -1)
    for seed in range(len(faces)):
        waiting = collections.deque([seed])
        while waiting:
            face = waiting.popleft()
            if group[face] >= 0:
                continue
            others, apart = beyond[face], hollow[face]
            forbidden = set(group[others[apart]])
            alike = [g for g in group[others[~apart]] if g >= 0 and g not in forbidden]
            group[face] = alike[0] if alike else next(g for g in range(4) if g not in forbidden)
            waiting.extendleft(others[~apart])
            waiting.extend(others[apart])
    return [np.flatnonzero(group == g) for g in range(group.max() + 1)]


def _neighbours(nodes: np.ndarray, faces: np.ndarray, sign: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the faces (f, 3) across the edges 01, 12 and 20 of each face, and whether those edges are hollow (f, 3)."""
    edges = np.sort(faces[:, [(0, 1), (1, 2), (2, 0)]].reshape(-1, 2), axis=1)
    order = np.lexsort(edges.T)  # a closed surface has every edge twice
    one, other = order[0::2], order[1::2]
    beyond = np.empty(len(edges), dtype=np.int64)
    beyond[one], beyond[other] = other // 3, one // 3
    corners = nodes[faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    unit = across / np.linalg.norm(across, axis=1, keepdims=True)
    face = np.repeat(np.arange(len(faces)), 3)
    middle = corners[beyond].mean(axis=1) - corners[face, np.tile([0, 1, 2], len(faces))]
    bent = np.linalg.norm(np.cross(unit[face], unit[beyond]), axis=1) > _FLAT
    hollow = bent & (sign * (middle * unit[face]).sum(axis=1) > 0.0)
    return beyond.reshape(-1, 3), hollow.reshape(-1, 3)
