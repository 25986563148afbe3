"""Filling a closed surface with tetrahedra: by Gmsh, and through fTetWild's surface where Gmsh's elements are badly shaped.

Gmsh comes first because it keeps flat faces flat, takes a second, and gives the same mesh every time; it also reads STEP files.
It keeps all edges where the surface turns sharply. Surfaces with needles, tiny edges and parts that nearly touch, as scans and
unions have them, get flat elements from it or none. fTetWild (Hu et al. 2020, package wildmeshing, MPL 2) fills any surface with
well-shaped elements, whose surface is within `TOLERANCE`; it takes ten times as long, and minutes for small elements. So it runs
once, coarsely (`coarse_filling`), and Gmsh makes smaller elements in the surface of that. TetGen has the AGPL; pytetwild,
another package of fTetWild, loads VTK.
"""

import logging
import time
from collections.abc import Callable

import numpy as np

from gravcomp.cache import cache_path, content_key
from gravcomp.mesh_files.coarse_filling import coarse_filling
from gravcomp.mesh_files.errors import MeshError
from gravcomp.mesh_files.flat_ends import with_flat_ends
from gravcomp.mesh_files.gmsh_filling import LONGEST, by_gmsh, within_triangles
from gravcomp.mesh_files.gmsh_library import GmshMissing
from gravcomp.mesh_files.kept_arrays import kept
from gravcomp.mesh_files.repair_surface import enclosed_volume
from gravcomp.mesh_files.repair_volume import boundary_triangles, cell_volumes
from gravcomp.mesh_files.wild_filling import TOLERANCE, by_wildmeshing

_FORMAT = 5  # part of the key; to be raised when the filling changes
# Shape of an element: 1 for a regular tetrahedron, 0 for a flat one. The worst one may not be below.
_SHAPE = 0.05
# Share of the volume by which elements may miss the body before another mesher is tried.
_VOLUME = 0.05
_LOGGER = logging.getLogger(__name__)
_Mesh = tuple[np.ndarray, np.ndarray]
_Mesher = Callable[[np.ndarray, np.ndarray, float, str], _Mesh]


def filled(
    nodes: np.ndarray, triangles: np.ndarray, length: float, element_size: float, elements_max: int, name: str
) -> tuple[np.ndarray, np.ndarray]:
    """Return nodes (n, 3) and linear tetrahedra (k, 4) of the body inside the triangles (f, 3); lengths in m.

    Nodes of flat faces at z = 0 and z = length lie there exactly. The result is kept in the cache. Raises MeshError: more
    elements than elements_max, no mesher is installed or none can fill it.
    """
    volume = enclosed_volume(nodes, triangles)
    expected = volume / (element_size**3 / (6.0 * np.sqrt(2.0)))
    if expected > 2.0 * elements_max:
        fits = size_of_elements(volume, elements_max)
        raise MeshError(
            f"{name}: about {expected:.2g} elements of this size fill the body; body.elements_max allows {elements_max}:"
            f" use element_size_mm: {1e3 * fits:.2g} or more, or raise elements_max (memory grows with it)"
        )
    key = content_key(_FORMAT, nodes, triangles, float(element_size))
    found = kept(cache_path("filled", key, ".npz"), lambda: _meshed(nodes, triangles, length, element_size, volume, name))
    if len(found[1]) > elements_max:
        raise MeshError(
            f"{name}: {len(found[1])} elements fill the body; body.elements_max allows {elements_max}:"
            " raise element_size_mm or elements_max (memory grows with it)"
        )
    return found


def size_of_elements(volume: float, count: int) -> float:
    """Return the edge length (m) of regular tetrahedra of which `count` have the volume (m^3)."""
    return float((volume * 6.0 * np.sqrt(2.0) / count) ** (1 / 3))


def shapes(nodes: np.ndarray, elements: np.ndarray) -> np.ndarray:
    """Return the shape (k,) of linear tetrahedra: volume over that of a regular one with the same root mean square edge."""
    regular = (_edge_lengths(nodes, elements) ** 2).mean(axis=1) ** 1.5 / (6.0 * np.sqrt(2.0))
    return cell_volumes(nodes, elements, "tet4") / np.maximum(regular, 1e-300)


def _meshed(
    nodes: np.ndarray, triangles: np.ndarray, length: float, element_size: float, volume: float, name: str
) -> tuple[np.ndarray, np.ndarray]:
    diagonal = float(np.linalg.norm(np.ptp(nodes, axis=0)))
    exact, tolerant = 1e-6 * diagonal, 2.0 * TOLERANCE * diagonal
    tried: list[str] = []

    def attempt(what: str, mesher: _Mesher, surface: _Mesh, within: float) -> _Mesh | None:
        """Return the filling; None, with the reason and the seconds in `tried`, where it fails or is bad."""
        _LOGGER.info("%s: filled by %s with elements of %.3g mm", name, what, 1e3 * element_size)
        start = time.monotonic()
        try:
            points, elements = with_flat_ends(*mesher(*surface, element_size, name), length, within)
        except GmshMissing:
            raise
        except MeshError as error:
            problem = str(error).removeprefix(f"{name}: ")
        else:
            worst = float(shapes(points, elements).min()) if len(elements) else 0.0
            share = float(cell_volumes(points, elements, "tet4").sum()) / volume
            if worst >= _SHAPE and abs(share - 1.0) <= _VOLUME:
                return points, elements
            problem = f"worst shape of an element {worst:.2g}, at least {_SHAPE:g}; volume {100 * share:.0f} % of the body's"
        tried.append(f"{what}, {time.monotonic() - start:.1f} s: {problem}")
        return None

    found = attempt("Gmsh", by_gmsh, (nodes, triangles), exact)
    if found is not None:
        return found
    _LOGGER.info("%s: %s", name, tried[-1])
    start = time.monotonic()
    try:
        coarse = coarse_filling(nodes, triangles, length, name)
    except MeshError as error:
        tried.append(f"{time.monotonic() - start:.1f} s: {str(error).removeprefix(f'{name}: ')}")
    else:
        if _edge_lengths(*coarse).max() <= LONGEST * element_size:
            found = attempt("fTetWild", lambda *_: coarse, coarse, exact)
        if found is None:
            used, faces = np.unique(boundary_triangles(coarse[1]), return_inverse=True)
            surface = coarse[0][used], faces.reshape(-1, 3)
            found = attempt("Gmsh in fTetWild's surface", within_triangles, surface, exact)
            found = found or attempt("fTetWild", by_wildmeshing, surface, tolerant)
        if found is not None:
            return found
    raise MeshError(f"{name}: the surface cannot be filled: {'; '.join(tried)}. Use a smaller element_size_mm")


def _edge_lengths(nodes: np.ndarray, elements: np.ndarray) -> np.ndarray:
    """The lengths (k, 6) of the edges of linear tetrahedra."""
    corners = nodes[elements]
    return np.linalg.norm(corners[:, [0, 0, 0, 1, 1, 2]] - corners[:, [1, 2, 3, 2, 3, 3]], axis=2)
