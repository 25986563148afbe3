"""Cuts across a body from a file: the boundary of its section at a height."""

import dataclasses
import functools

import numpy as np

from gravcomp.config import ConfigError
from gravcomp.description import Material, MeshBody
from gravcomp.mesh.elements import edges, faces, reference_nodes, shape_values
from gravcomp.mesh.mesh import MeshError
from gravcomp.mesh_files.level_cut import level_cut
from gravcomp.rest_axis import straightened
from gravcomp.virtual.cross_section import CrossSection, sliced_section

# Off the plane of a layer of nodes, relative to the length.
_OFF_NODES = 1e-6
_DIVISIONS = 4  # of the edges of a curved face


def slice_of(body: MeshBody, part: float) -> CrossSection:
    """Return the section constants at `part` of the length. Raises ConfigError for a body without a section there."""
    segments, height = _slice(body, part)
    section = sliced_section(segments)
    if section is None:
        raise _missing(body, height)
    return section


def slice_boundary(body: MeshBody, part: float) -> np.ndarray:
    """Return points (k, 2) in m of the boundary at `part` of the length. Raises ConfigError where there is no section."""
    segments, height = _slice(body, part)
    if len(segments) < 3:
        raise _missing(body, height)
    return segments.reshape(-1, 2)


def _slice(body: MeshBody, part: float) -> tuple[np.ndarray, float]:
    """Boundary (k, 2, 2) and height, in m, of the section at `part` of the length."""
    triangles, length = _surface(dataclasses.replace(body, material=Material()))
    height = length * min(max(part, 10 * _OFF_NODES), 1.0 - 10 * _OFF_NODES) + _OFF_NODES * length
    return level_cut(triangles, height), height


def _missing(body: MeshBody, height: float) -> ConfigError:
    return ConfigError(f"{body.file}: no cross-section at {1e3 * height:g} mm; the virtual robot needs one everywhere")


@functools.lru_cache(maxsize=4)
def _surface(body: MeshBody) -> tuple[np.ndarray, float]:
    """Surface (t, 3, 3) in m of the straightened body, each triangle counter-clockwise from outside, and the length.

    Curved faces are divided, so that the triangles follow them. Raises ConfigError.
    """
    try:
        placed = body.placed()
    except MeshError as error:
        raise ConfigError(str(error)) from error
    nodes = straightened(placed.axis, placed.nodes, placed.length) if placed.axis.bent else placed.nodes
    if placed.kind == "tri3":
        return nodes[placed.cells], placed.length
    kind, elements = placed.kind, placed.cells
    corner_faces = faces(kind)
    corners, size = int(edges(kind).max()) + 1, corner_faces.shape[1]
    key = np.sort(elements[:, corner_faces].reshape(-1, size), axis=1)
    _, first, count = np.unique(key, axis=0, return_index=True, return_counts=True)
    outer = first[count == 1]
    element, face = outer // len(corner_faces), outer % len(corner_faces)
    weights, triangles = _divided(size, 1 if elements.shape[1] == corners else _DIVISIONS)
    local = np.einsum("pc,fci->fpi", weights, reference_nodes(kind)[corner_faces])
    points = np.einsum("fpn,fni->fpi", shape_values(kind, local)[face], nodes[elements[element]])
    found = points[:, triangles]  # (f, t, 3, 3)
    inside = nodes[elements[element, :corners]].mean(axis=1)
    normal = np.cross(found[..., 1, :] - found[..., 0, :], found[..., 2, :] - found[..., 0, :])
    # Of the face as a whole: a part of a curved face may look towards the middle of its element.
    inward = np.einsum("fi,fi->f", normal.sum(axis=1), found.mean(axis=(1, 2)) - inside) < 0.0
    found[inward] = found[inward][:, :, ::-1]
    return found.reshape(-1, 3, 3), placed.length


def _divided(corners: int, parts: int) -> tuple[np.ndarray, np.ndarray]:
    """Points of a face with 3 or 4 corners as weights (p, corners), and triangles (t, 3) between them."""
    steps = np.arange(parts + 1) / parts
    place = {}
    weights: list[list[float]] = []
    for i, u in enumerate(steps):
        for j, v in enumerate(steps):
            if corners == 3 and i + j > parts:
                continue
            place[i, j] = len(weights)
            weights.append([1 - u - v, u, v] if corners == 3 else [(1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v])
    triangles = []
    for i, j in place:
        for cell in (((i, j), (i + 1, j), (i, j + 1)), ((i + 1, j), (i + 1, j + 1), (i, j + 1))):
            if all(corner in place for corner in cell):
                triangles.append([place[corner] for corner in cell])
    return np.array(weights), np.array(triangles)
