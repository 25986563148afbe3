"""Nodes that lie at the same place, and cells that hang together."""

import numpy as np

# Nodes nearer than this part of the body's diagonal are one node: files with single precision round by 1e-7.
_SAME_PLACE = 1e-6


def welded(nodes: np.ndarray, cells: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """Merge the nodes that cells use and that lie at the same place.

    Returns the nodes in use (n, 3), the cells with their numbers (k, c), and how many nodes were merged.
    """
    from scipy.spatial import cKDTree

    used, numbers = np.unique(cells, return_inverse=True)
    nodes, cells = nodes[used], numbers.reshape(cells.shape)
    pairs = cKDTree(nodes).query_pairs(_SAME_PLACE * float(np.linalg.norm(np.ptp(nodes, axis=0))), output_type="ndarray")
    if not len(pairs):
        return nodes, cells, 0
    group = _labels(len(nodes), pairs[:, 0], pairs[:, 1])
    _, first, label = np.unique(group, return_index=True, return_inverse=True)
    return nodes[first], label[cells], len(nodes) - len(first)


def components(count: int, one: np.ndarray, other: np.ndarray) -> list[np.ndarray]:
    """Return the members (of 0 ... count - 1) of each connected part of a graph with the edges one[i] - other[i]."""
    label = _labels(count, one, other)
    order = np.argsort(label, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(label[order])) + 1)


def _labels(count: int, one: np.ndarray, other: np.ndarray) -> np.ndarray:
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    graph = coo_matrix((np.ones(len(one), dtype=np.int8), (one, other)), shape=(count, count))
    return connected_components(graph, directed=False)[1]
