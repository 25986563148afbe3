"""Repairing surfaces: repeated points and triangles, their direction, small and flat holes. What cannot be repaired is refused.

A refusal that has a place comes with a picture of it (`flaw_picture`).
"""

from pathlib import Path

import numpy as np

from gravcomp.mesh_files.errors import MeshError
from gravcomp.mesh_files.flaw_picture import with_picture
from gravcomp.mesh_files.holes import fill_holes, open_edges
from gravcomp.mesh_files.raw_mesh import RawMesh
from gravcomp.mesh_files.repair_volume import require_numbers, require_one_body
from gravcomp.mesh_files.self_intersection import intersecting_triangles
from gravcomp.mesh_files.welding import components, welded
from gravcomp.mesh_files.winding import directed_edges, edge_pairs, wound_alike

# Points on both sides of a gap up to this part of the diagonal are joined.
_GAP = 1e-4


def repaired_surface(mesh: RawMesh, path: Path) -> RawMesh:
    """Return the closed surface, facing outward; its notes say what was repaired.

    Raises MeshError: coordinates that are not numbers, no volume, an open surface, edges with more than two triangles, one side
    only, several bodies, a surface that passes through itself.
    """
    name = str(path)
    require_numbers(mesh.nodes, name)
    nodes, faces, _ = welded(mesh.nodes, mesh.cells)
    notes: list[str] = []
    faces = _without_idle(nodes, faces, notes)
    if len(faces) == 0:
        raise MeshError(f"{name}: has no volume: all its triangles have collapsed")
    nodes, faces = _stitched(nodes, faces, notes)
    _refuse_branches(nodes, faces, path)
    one, other, alike = edge_pairs(faces)
    require_one_body(nodes, faces, components(len(faces), one, other), "triangles", name)
    turned = wound_alike(faces, one, other, alike)
    if turned is None:
        raise MeshError(f"{name}: the surface has one side only, like a Moebius band; a closed surface is needed")
    if (flipped := int((turned[:, 1] != faces[:, 1]).sum())) and flipped != len(faces):
        notes.append(f"{min(flipped, len(faces) - flipped)} triangles that faced the other way were turned over")
    nodes, faces = fill_holes(nodes, turned, path, notes)
    volume = enclosed_volume(nodes, faces)
    if abs(volume) <= 1e-9 * float(np.linalg.norm(np.ptp(nodes, axis=0))) ** 3:
        raise MeshError(f"{name}: has no volume: its surface encloses {volume:.3g} cubic units")
    if volume < 0.0:
        notes.append("the surface faced inward and was turned over")
        faces = faces[:, ::-1]
    crossing = intersecting_triangles(nodes, faces)
    if len(crossing):
        places = nodes[faces[crossing]].mean(axis=1)
        raise with_picture(
            f"{name}: the surface passes through itself at {len(crossing)} triangles, {_at(places[0])}; unite its parts",
            path, nodes, faces, places,
        )  # fmt: skip
    return RawMesh("tri3", nodes, faces, mesh.unit, (*mesh.notes, *notes))


def enclosed_volume(nodes: np.ndarray, faces: np.ndarray) -> float:
    """Return the volume inside a closed surface, positive when it faces outward."""
    a, b, c = (nodes[faces[:, i]] - nodes[0] for i in range(3))
    return float(np.einsum("ki,ki->", np.cross(a, b), c)) / 6.0


def _without_idle(nodes: np.ndarray, faces: np.ndarray, notes: list[str]) -> np.ndarray:
    """The triangles without those that have collapsed to an edge, and without repeated ones."""
    whole = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    kept = faces[whole]
    _, first = np.unique(np.sort(kept, axis=1), axis=0, return_index=True)
    for count, what in (((~whole).sum(), "collapsed"), (len(kept) - len(first), "repeated")):
        if count:
            notes.append(f"{count} {what} triangles were removed")
    return kept[np.sort(first)]


def _stitched(nodes: np.ndarray, faces: np.ndarray, notes: list[str]) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and triangles with the points of open edges joined where a gap is narrow, if that closes edges."""
    from scipy.spatial import cKDTree

    before = open_edges(faces)
    if not len(before):
        return nodes, faces
    rim = np.unique(before)
    pairs = cKDTree(nodes[rim]).query_pairs(_GAP * float(np.linalg.norm(np.ptp(nodes, axis=0))), output_type="ndarray")
    if not len(pairs):
        return nodes, faces
    number = np.arange(len(nodes))
    for part in components(len(rim), pairs[:, 0], pairs[:, 1]):
        number[rim[part]] = rim[part].min()
    joined = _without_idle(nodes, number[faces], [])
    after = len(open_edges(joined))
    if after >= len(before):
        return nodes, faces
    notes.append(f"{len(before) - after} open edges were joined across gaps of up to {100 * _GAP:g} % of the size")
    return nodes, joined


def _refuse_branches(nodes: np.ndarray, faces: np.ndarray, path: Path) -> None:
    edges = np.sort(directed_edges(faces), axis=1)
    unique, count = np.unique(edges, axis=0, return_counts=True)
    branched = unique[count > 2]
    if len(branched):
        places = nodes[branched].mean(axis=1)
        raise with_picture(
            f"{path}: {len(branched)} edges belong to more than two triangles, {_at(places[0])}: walls inside the body, or two"
            " bodies that touch; one closed surface is needed",
            path, nodes, faces, places,
        )  # fmt: skip


def _at(place: np.ndarray) -> str:
    return f"first at ({', '.join(f'{x:.4g}' for x in place)}) units"
