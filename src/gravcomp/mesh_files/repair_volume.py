"""Repairing volume meshes: repeated nodes and elements, collapsed and inverted elements. What cannot be repaired is refused."""

import numpy as np

from gravcomp.mesh_files.errors import MeshError
from gravcomp.mesh_files.raw_mesh import RawMesh
from gravcomp.mesh_files.welding import components, welded

# Corners of the faces; seen from outside they run counterclockwise.
_TET_FACES = np.array([(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)])
_HEX_FACES = np.array([(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)])
_HEX_EDGES = np.array([(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)])
# The order of the nodes of the mirrored element.
_MIRRORED = {
    "tet4": (0, 2, 1, 3),
    "tet10": (0, 2, 1, 3, 6, 5, 4, 7, 9, 8),
    "hex8": (4, 5, 6, 7, 0, 1, 2, 3),
    "hex20": (4, 5, 6, 7, 0, 1, 2, 3, 12, 13, 14, 15, 8, 9, 10, 11, 16, 17, 18, 19),
}
# The six tetrahedra of a hexahedron.
_HEX_PARTS = np.array([(0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)])
# An element with a smaller share of the volume of the median element has collapsed.
_COLLAPSED = 1e-6
# Elements around a face among which its neighbour is sought.
_NEIGHBOURS = 24


def repaired_volume(mesh: RawMesh, name: str) -> RawMesh:
    """Return the mesh without flaws; its notes say what was repaired. Linear hexahedra become 20-node ones.

    `name` stands in the errors. Raises MeshError: coordinates that are not numbers, no volume, elements that overlap, several
    bodies.
    """
    require_numbers(mesh.nodes, name)
    nodes, cells, notes = mesh.nodes, mesh.cells, []
    if len(cells) == 0 or cells.min() < 0 or cells.max() >= len(nodes):
        raise MeshError(f"{name}: its elements name nodes that it does not have ({len(nodes)} nodes)")
    nodes, cells, merged = welded(nodes, cells)
    if merged:
        notes.append(f"{merged} repeated nodes were merged")
    _, first = np.unique(np.sort(cells, axis=1), axis=0, return_index=True)
    if len(first) < len(cells):
        notes.append(f"{len(cells) - len(first)} repeated elements were removed")
        cells = cells[np.sort(first)]
    volume = cell_volumes(nodes, cells, mesh.kind)
    typical = float(np.median(np.abs(volume)))
    extent = np.ptp(nodes, axis=0)
    if typical <= 1e-12 * float(extent.max()) ** 3 / len(cells):
        raise MeshError(f"{name}: has no volume: {len(cells)} elements of together {np.abs(volume).sum():.3g} cubic units")
    kept = np.abs(volume) > _COLLAPSED * typical
    if not kept.all():
        notes.append(f"{int((~kept).sum())} collapsed elements were removed")
        cells, volume = cells[kept], volume[kept]
    inverted = volume < 0
    if inverted.any():
        notes.append(f"{int(inverted.sum())} inverted elements of {len(cells)} were turned over")
        cells = cells.copy()
        cells[inverted] = cells[inverted][:, _MIRRORED[mesh.kind]]
    _refuse_overlap(nodes, cells, name)
    require_one_body(nodes, cells, _bodies(cells), "elements", name)
    if covered := _covered_faces(nodes, cells):
        notes.append(f"{covered} faces of elements touch a neighbour without sharing its nodes: the body has cracks there")
    kind = mesh.kind
    if kind == "hex8":
        kind, nodes, cells = "hex20", *_raised_hexahedra(nodes, cells)
        notes.append("linear hexahedra were raised to quadratic ones with straight sides")
    used, numbers = np.unique(cells, return_inverse=True)
    return RawMesh(kind, nodes[used], numbers.reshape(cells.shape), mesh.unit, (*mesh.notes, *notes))


def require_numbers(nodes: np.ndarray, name: str) -> None:
    """Raise MeshError for coordinates that are not finite."""
    bad = np.flatnonzero(~np.isfinite(nodes).all(axis=1))
    if len(bad):
        raise MeshError(
            f"{name}: {len(bad)} of {len(nodes)} points have coordinates that are not finite numbers, the first is point"
            f" {bad[0]} at ({', '.join(f'{x:g}' for x in nodes[bad[0]])})"
        )


def require_one_body(nodes: np.ndarray, cells: np.ndarray, parts: list[np.ndarray], what: str, name: str) -> None:
    """Raise MeshError unless there is one part; parts: indices of the cells of each; `what`: the word for cells."""
    if len(parts) > 1:
        parts = sorted(parts, key=len, reverse=True)
        sizes = [" x ".join(f"{x:.4g}" for x in np.ptp(nodes[np.unique(cells[part])], axis=0)) for part in parts[:3]]
        found = ", ".join(f"{len(part)} {what} ({size} units)" for part, size in zip(parts, sizes))
        more = f" and {len(parts) - 3} smaller ones" if len(parts) > 3 else ""
        raise MeshError(f"{name}: consists of {len(parts)} separate bodies: {found}{more}; one body is needed")


def cell_volumes(nodes: np.ndarray, cells: np.ndarray, kind: str) -> np.ndarray:
    """Return the signed volumes (k,) of the elements with plane faces through their corners."""
    parts = np.array([(0, 1, 2, 3)]) if kind.startswith("tet") else _HEX_PARTS
    corners = nodes[cells[:, parts]]
    edges = corners[:, :, 1:] - corners[:, :, :1]
    return np.einsum("kpi,kpi->k", np.cross(edges[:, :, 0], edges[:, :, 1]), edges[:, :, 2]) / 6.0


def boundary_triangles(cells: np.ndarray) -> np.ndarray:
    """Return the triangles (f, 3) around the elements, facing outward."""
    faces = _faces(cells)
    _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    outer = faces[first[count == 1]]
    return outer if outer.shape[1] == 3 else np.vstack([outer[:, [0, 1, 2]], outer[:, [0, 2, 3]]])


def _faces(cells: np.ndarray) -> np.ndarray:
    """Corners of all faces (k f, 3 or 4), those of an element one after the other."""
    corners = _TET_FACES if cells.shape[1] in (4, 10) else _HEX_FACES
    return cells[:, corners].reshape(-1, corners.shape[1])


def _refuse_overlap(nodes: np.ndarray, cells: np.ndarray, name: str) -> None:
    """Two elements on the same side of a face overlap: the mesh is folded."""
    faces = _faces(cells)
    start = np.argmin(faces, axis=1)
    turned = faces[np.arange(len(faces))[:, None], (start[:, None] + np.arange(faces.shape[1])) % faces.shape[1]]
    _, first, count = np.unique(turned, axis=0, return_index=True, return_counts=True)
    if (count > 1).any():
        x, y, z = nodes[turned[first[count > 1][0]]].mean(axis=0)
        raise MeshError(
            f"{name}: the mesh is folded: at {int((count > 1).sum())} faces the elements of both sides overlap, first at"
            f" ({x:.4g}, {y:.4g}, {z:.4g}) units; mesh the body again"
        )


def _covered_faces(nodes: np.ndarray, cells: np.ndarray) -> int:
    """How many free triangles have another element just outside of them: neighbours whose faces do not match."""
    from scipy.spatial import cKDTree

    parts = np.array([(0, 1, 2, 3)]) if cells.shape[1] in (4, 10) else _HEX_PARTS
    corners = nodes[cells[:, parts].reshape(-1, 4)]
    inverse = np.linalg.inv((corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1))
    faces = nodes[boundary_triangles(cells)]
    normal = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
    size = np.sqrt(np.linalg.norm(normal, axis=1))
    outside = faces.mean(axis=1) + 1e-3 * normal / np.maximum(size, 1e-300)[:, None]
    _, near = cKDTree(corners.mean(axis=1)).query(outside, k=min(_NEIGHBOURS, len(corners)))
    local = np.einsum("fnij,fnj->fni", inverse[near], outside[:, None] - corners[near, 0])
    within = (local.min(axis=2) > -1e-6) & (local.sum(axis=2) < 1.0 + 1e-6)
    return int(within.any(axis=1).sum())


def _bodies(cells: np.ndarray) -> list[np.ndarray]:
    """Elements of each part that hangs together by faces."""
    faces = np.sort(_faces(cells), axis=1)
    _, number = np.unique(faces, axis=0, return_inverse=True)
    owner = np.repeat(np.arange(len(cells)), len(faces) // len(cells))
    order = np.argsort(number, kind="stable")
    same = number[order][1:] == number[order][:-1]
    return components(len(cells), owner[order][:-1][same], owner[order][1:][same])


def _raised_hexahedra(nodes: np.ndarray, cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and 20-node hexahedra, with a node in the middle of every edge."""
    edges = np.sort(cells[:, _HEX_EDGES].reshape(-1, 2), axis=1)
    unique, index = np.unique(edges, axis=0, return_inverse=True)
    return np.vstack([nodes, nodes[unique].mean(axis=1)]), np.hstack([cells, len(nodes) + index.reshape(len(cells), 12)])
