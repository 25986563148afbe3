"""Holes of a surface: small ones and flat ones are filled, others are refused with a picture of where they are."""

from pathlib import Path

import numpy as np

from gravcomp.mesh_files.flaw_picture import with_picture
from gravcomp.mesh_files.winding import directed_edges

# A hole is small up to this part of the body's diagonal, and flat when it leaves its plane by no more than this part of its size.
_SMALL, _FLAT = 0.05, 0.01


def open_edges(faces: np.ndarray) -> np.ndarray:
    """Return the directed edges (e, 2) that belong to one triangle only."""
    directed = directed_edges(faces)
    _, first, count = np.unique(np.sort(directed, axis=1), axis=0, return_index=True, return_counts=True)
    return directed[first[count == 1]]


def fill_holes(nodes: np.ndarray, faces: np.ndarray, path: Path, notes: list[str]) -> tuple[np.ndarray, np.ndarray]:
    """Return nodes and triangles with the holes filled that can be; the triangles must face alike. Adds sentences to `notes`.

    Raises MeshError for a hole that is neither small nor flat, for one in the plane of another (the end of a tube: nobody knows
    whether the lumen is open), and for rims that meet in a point.
    """
    edges = open_edges(faces)
    if not len(edges):
        return nodes, faces
    rims = _rims(edges)
    diagonal = float(np.linalg.norm(np.ptp(nodes, axis=0)))
    if rims is None:
        text = f"{path}: the surface is not closed: {len(edges)} edges belong to one triangle, and its holes meet in points"
        raise with_picture(f"{text}; close them", path, nodes, faces, nodes[edges].mean(axis=1))
    caps = [_cap(nodes[rim]) for rim in rims]
    size = [float(np.linalg.norm(np.ptp(nodes[rim], axis=0))) for rim in rims]
    middle = np.array([nodes[rim].mean(axis=0) for rim in rims])
    left = []
    for index, (rim, cap) in enumerate(zip(rims, caps)):
        normal, height = cap
        coplanar = [
            other for other in range(len(rims))
            if other != index and size[other] > _SMALL * diagonal and abs(caps[other][0] @ normal) > 0.99
            and abs((middle[other] - middle[index]) @ normal) < _FLAT * max(size[index], size[other])
        ]  # fmt: skip
        small, flat = size[index] <= _SMALL * diagonal, height <= _FLAT * size[index] and not coplanar
        fan = np.column_stack([np.full(len(rim), len(nodes)), np.roll(rim, -1), rim])
        if not (small or flat) or not _star_shaped(nodes[rim], middle[index], normal):
            left.append(index)
            continue
        nodes, faces = np.vstack([nodes, middle[index]]), np.vstack([faces, fan])
        place = ", ".join(f"{x:.4g}" for x in middle[index])
        notes.append(f"a {'small' if small else 'flat'} hole of {size[index]:.3g} units at ({place}) was filled")
    if left:
        places = np.vstack([nodes[rims[index]] for index in left])
        found = "; ".join(
            f"{size[index]:.3g} units wide at ({', '.join(f'{x:.4g}' for x in middle[index])})" for index in left[:4]
        )
        raise with_picture(
            f"{path}: the surface is not closed: {len(left)} holes are neither small (up to {100 * _SMALL:g} % of the size) nor"
            f" flat and alone in their plane: {found}; close them",
            path, nodes, faces, places,
        )  # fmt: skip
    return nodes, faces


def _rims(edges: np.ndarray) -> list[np.ndarray] | None:
    """Nodes of every hole in order around it; None where rims touch."""
    if len(np.unique(edges[:, 0])) < len(edges) or len(np.unique(edges[:, 1])) < len(edges):
        return None
    after = dict(edges.tolist())
    rims = []
    while after:
        start, node = next(iter(after.items()))
        rim = [start]
        del after[start]
        while node != start:
            rim.append(node)
            if node not in after:
                return None
            node = after.pop(node)
        rims.append(np.array(rim))
    return rims


def _cap(rim: np.ndarray) -> tuple[np.ndarray, float]:
    """Normal (3,) of the plane through a rim (n, 3), and how far the rim leaves it."""
    offset = rim - rim.mean(axis=0)
    area = np.cross(offset, np.roll(offset, -1, axis=0)).sum(axis=0)
    length = float(np.linalg.norm(area))
    normal = area / length if length > 0.0 else np.linalg.svd(offset)[2][2]
    return normal, float(np.ptp(offset @ normal))


def _star_shaped(rim: np.ndarray, middle: np.ndarray, normal: np.ndarray) -> bool:
    """Whether the triangles from the middle to every edge of the rim all face one way."""
    offset = rim - middle
    return bool((np.cross(offset, np.roll(offset, -1, axis=0)) @ normal > 0.0).all())
