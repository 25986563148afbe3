"""A body filled coarsely by fTetWild, whose elements have a surface without needles, tiny edges and parts that nearly touch.

fTetWild takes seconds for a coarse filling of a surface, and minutes for a fine one. So it runs once for a surface, and the
filling is kept in the cache, by content: Gmsh fills its surface with elements of any size in about a second.
"""

import logging

import numpy as np

from gravcomp.cache import cache_path, content_key
from gravcomp.mesh_files.errors import MeshError
from gravcomp.mesh_files.flat_ends import with_flat_ends
from gravcomp.mesh_files.kept_arrays import kept
from gravcomp.mesh_files.wild_filling import TOLERANCE, by_wildmeshing

_FORMAT = 1  # part of the key; to be raised when the filling changes
# Edges over the diagonal: shorter where the shape needs it.
_COARSE = 0.1
# What fTetWild has said of surfaces that it cannot fill, by key: with the next size it would say the same.
_refused: dict[str, str] = {}


def coarse_filling(nodes: np.ndarray, triangles: np.ndarray, length: float, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return nodes (n, 3) and linear tetrahedra (k, 4) of the body inside the triangles; lengths in m.

    Nodes of flat faces at z = 0 and z = length lie there exactly. Raises MeshError where fTetWild is missing or fails, and at
    once where it has failed before in this process.
    """
    key = content_key(_FORMAT, nodes, triangles, length)
    if key in _refused:
        raise MeshError(_refused[key])
    return kept(cache_path("coarse", key, ".npz"), lambda: _computed(key, nodes, triangles, length, name))


def _computed(key: str, nodes: np.ndarray, triangles: np.ndarray, length: float, name: str) -> tuple[np.ndarray, np.ndarray]:
    logging.getLogger(__name__).info("%s: fTetWild fills it coarsely, once for this surface, in seconds to minutes", name)
    diagonal = float(np.linalg.norm(np.ptp(nodes, axis=0)))
    try:
        points, elements = by_wildmeshing(nodes, triangles, _COARSE * diagonal, name)
    except MeshError as error:
        _refused[key] = str(error)
        raise
    return with_flat_ends(points, elements, length, 2.0 * TOLERANCE * diagonal)
