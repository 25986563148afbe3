"""Filling a closed surface with tetrahedra: by Gmsh, and by fTetWild where Gmsh's elements are badly shaped.

Gmsh comes first because it keeps flat faces flat, takes a second, and gives the same mesh every time; it also reads STEP files.
Surfaces with needles and tiny edges, as scans and unions have, it fills with flat elements or not at all. fTetWild (Hu et al.
2020, package wildmeshing, MPL 2) fills any surface with well-shaped elements, whose surface is within a thousandth of the size;
it takes ten times as long. TetGen has the AGPL; pytetwild, another package of fTetWild, loads VTK.
"""

import tempfile
from pathlib import Path

import numpy as np

from gravcomp.cache import cache_path, content_key
from gravcomp.mesh_files.errors import MeshError
from gravcomp.mesh_files.gmsh_filling import by_gmsh
from gravcomp.mesh_files.gmsh_library import GmshMissing
from gravcomp.mesh_files.repair_surface import enclosed_volume
from gravcomp.mesh_files.repair_volume import boundary_triangles, cell_volumes
from gravcomp.mesh_files.wild_filling import TOLERANCE, by_wildmeshing

_FORMAT = 3
# Shape of an element: 1 for a regular tetrahedron, 0 for a flat one. The worst one may not be below.
_SHAPE = 0.05
# Share of the volume by which elements may miss the body before another mesher is tried.
_VOLUME = 0.05
_FLAT = 0.95


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
    stored = cache_path("filled", content_key(_FORMAT, nodes, triangles, float(element_size)), ".npz")
    if stored.exists():
        with np.load(stored) as content:
            found = content["nodes"], content["elements"]
    else:
        found = _meshed(nodes, triangles, length, element_size, volume, name)
        with tempfile.NamedTemporaryFile(dir=stored.parent, suffix=".npz", delete=False) as partial:
            np.savez(partial, nodes=found[0], elements=found[1])
        Path(partial.name).replace(stored)
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
    corners = nodes[elements]
    edges = corners[:, [0, 0, 0, 1, 1, 2]] - corners[:, [1, 2, 3, 2, 3, 3]]
    regular = ((edges**2).sum(axis=2).mean(axis=1)) ** 1.5 / (6.0 * np.sqrt(2.0))
    return cell_volumes(nodes, elements, "tet4") / np.maximum(regular, 1e-300)


def _meshed(
    nodes: np.ndarray, triangles: np.ndarray, length: float, element_size: float, volume: float, name: str
) -> tuple[np.ndarray, np.ndarray]:
    problems: list[str] = []
    diagonal = float(np.linalg.norm(np.ptp(nodes, axis=0)))
    for mesher, within in ((by_gmsh, 1e-6 * diagonal), (by_wildmeshing, 2.0 * TOLERANCE * diagonal)):
        try:
            found = mesher(nodes, triangles, element_size, name)
        except GmshMissing:
            raise
        except MeshError as error:
            problems.append(str(error))
            continue
        points, elements = _flattened(*found, length, within)
        worst = float(shapes(points, elements).min()) if len(elements) else 0.0
        share = float(cell_volumes(points, elements, "tet4").sum()) / volume
        if worst >= _SHAPE and abs(share - 1.0) <= _VOLUME:
            return points, elements
        problems.append(f"{mesher.__name__[3:]}: worst shape of an element {worst:.2g}, volume {100 * share:.0f} % of the body's")
    raise MeshError(f"{name}: the surface cannot be filled: {'; '.join(problems)}; use a smaller element_size_mm")


def _flattened(nodes: np.ndarray, elements: np.ndarray, length: float, within: float) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and elements (positively oriented) with the nodes of faces at z = 0 and z = length, up to `within`, put there."""
    elements = elements.copy()
    inverted = cell_volumes(nodes, elements, "tet4") < 0.0
    elements[inverted] = elements[inverted][:, [0, 2, 1, 3]]
    faces = boundary_triangles(elements)
    corners = nodes[faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    upward = normal[:, 2] / np.maximum(np.linalg.norm(normal, axis=1), 1e-300)
    nodes = nodes.copy()
    for plane, sign in ((0.0, -1.0), (length, 1.0)):
        flat = (sign * upward > _FLAT) & (np.abs(corners[:, :, 2] - plane) <= within).all(axis=1)
        nodes[np.unique(faces[flat]), 2] = plane
    return nodes, elements
