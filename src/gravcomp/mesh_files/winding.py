"""The edges of a surface, and the direction in which its triangles face."""

import numpy as np


def directed_edges(faces: np.ndarray) -> np.ndarray:
    """Return the edges (3 f, 2) of the triangles (f, 3), those of a triangle one after the other, in the order around it."""
    return faces[:, [(0, 1), (1, 2), (2, 0)]].reshape(-1, 2)


def edge_pairs(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the triangles on both sides of every shared edge (e,), (e,), and whether they face alike (e,)."""
    directed = directed_edges(faces)
    owner = np.repeat(np.arange(len(faces)), 3)
    forward = directed[:, 0] < directed[:, 1]
    _, number = np.unique(np.sort(directed, axis=1), axis=0, return_inverse=True)
    order = np.argsort(number, kind="stable")
    same = np.flatnonzero(number[order][1:] == number[order][:-1])
    one, other = order[same], order[same + 1]
    return owner[one], owner[other], forward[one] != forward[other]


def wound_alike(faces: np.ndarray, one: np.ndarray, other: np.ndarray, alike: np.ndarray) -> np.ndarray | None:
    """Return the triangles of one connected surface, those turned over that face another way than the first.

    one, other and alike (e,) are their `edge_pairs`. None if they cannot all face alike.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import breadth_first_order

    if alike.all():
        return faces
    value = np.where(alike, 1, 2)
    graph = coo_matrix(
        (np.tile(value, 2), (np.concatenate([one, other]), np.concatenate([other, one]))), shape=(len(faces), len(faces))
    )
    relation = dict(zip(zip(one.tolist(), other.tolist()), alike.tolist()))
    relation |= {(b, a): same for (a, b), same in list(relation.items())}
    order, before = breadth_first_order(graph.tocsr(), 0, directed=False)
    turned = np.zeros(len(faces), dtype=bool)
    for face in order[1:].tolist():
        turned[face] = turned[before[face]] ^ (not relation[before[face], face])
    if (turned[one] ^ turned[other] == alike).any():
        return None
    result = faces.copy()
    result[turned] = faces[turned][:, [0, 2, 1]]
    return result
