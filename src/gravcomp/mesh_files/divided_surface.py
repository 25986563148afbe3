"""A surface whose long edges are divided: the shape stays, triangles become as small as elements are to be."""

import numpy as np

from gravcomp.mesh_files.winding import directed_edges


def with_short_edges(nodes: np.ndarray, faces: np.ndarray, longest: float) -> tuple[np.ndarray, np.ndarray]:
    """Return nodes (n, 3) and triangles (f, 3) of a closed surface whose edges are halved until none is longer than `longest`.

    Each time the edges are halved that are the longest ones of both their triangles, which keeps the triangles from becoming
    ever flatter (M. C. Rivara 1984).
    """
    while True:
        edges, number = np.unique(np.sort(directed_edges(faces), axis=1), axis=0, return_inverse=True)
        sides = number.reshape(-1, 3)
        length = np.linalg.norm(nodes[edges[:, 0]] - nodes[edges[:, 1]], axis=1)
        # Of equal edges the one with the larger number, in both triangles: so one edge is always the longest of both.
        rank = np.empty(len(edges), dtype=np.int64)
        rank[np.argsort(length, kind="stable")] = np.arange(len(edges))
        side = rank[sides].argmax(axis=1)
        own = sides[np.arange(len(faces)), side]
        halved = (length > longest) & (np.bincount(own, minlength=len(edges)) == 2)
        if not halved.any():
            return nodes, faces
        middle = np.zeros(len(edges), dtype=np.int64)
        middle[halved] = len(nodes) + np.arange(halved.sum())
        nodes = np.vstack([nodes, nodes[edges[halved]].mean(axis=1)])
        cut = halved[own]
        a, b, c = (faces[cut, (side[cut] + turn) % 3] for turn in range(3))
        m = middle[own[cut]]
        faces = np.concatenate([faces[~cut], np.column_stack([a, m, c]), np.column_stack([m, b, c])])
