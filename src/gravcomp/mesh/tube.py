"""Meshes of a row of tubes from their dimensions, graded toward the clamp, where the stress is singular.

A grid in (radius, angle, z) has a plane at every radius and height where a tube begins or ends, so that tubes of different
diameters share their nodes. Its cells become 20-node hexahedra, or six tetrahedra each (Kuhn's division).
"""

import itertools

import numpy as np

from gravcomp.description import Robot
from gravcomp.mesh.elements import is_hexahedron, reference_nodes
from gravcomp.mesh.mesh import Mesh, MeshError
from gravcomp.mesh.quadratic import TET_EDGES


def tube_mesh(
    robot: Robot, kind: str = "hex20", around: int | None = None, along: int | None = None, radial: int | None = None
) -> Mesh:
    """Return the mesh of the robot's segments; numbers of elements that are not given are the robot's.

    kind: one of `elements.KINDS`. Raises MeshError for fewer elements along the robot than tubes and caps.
    """
    around = around or robot.elements.around
    along = along or robot.elements.along
    radial = radial or robot.elements.radial
    pieces = _pieces(robot)
    heights, piece_of_layer = _layers([p[0] for p in pieces], along, robot.elements.grading)
    radii = _radii(pieces, radial)

    corners = []
    for layer, piece in enumerate(piece_of_layer):
        _, inner, outer, _ = pieces[piece]
        for ring in range(len(radii) - 1):
            if inner - 1e-9 <= radii[ring] and radii[ring + 1] <= outer + 1e-9:
                corners += [(2 * ring, 2 * sector, 2 * layer, piece) for sector in range(around)]
    cells = np.array(corners)
    origin, pieces_of_cells = cells[:, :3], cells[:, 3]
    # Nodes of an element in (radial, around, along) half steps of its cell.
    patterns = [np.rint(reference_nodes(kind) + 1).astype(int)] if is_hexahedron(kind) else _kuhn(quadratic=kind == "tet10")
    grid = np.concatenate([origin[:, None, :] + pattern for pattern in patterns])
    region = np.concatenate([pieces_of_cells] * len(patterns))
    grid[:, :, 1] %= 2 * around

    shape = (2 * len(radii), 2 * around, 2 * len(heights))
    used, elements = np.unique(np.ravel_multi_index(tuple(np.moveaxis(grid, -1, 0)), shape), return_inverse=True)
    i, j, k = np.unravel_index(used, shape)
    radius, height = _halved(radii)[i], _halved(heights)[k]
    angle = np.pi * j / around
    nodes = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), height])
    materials = tuple(p[3] for p in pieces)
    return Mesh(kind, nodes, elements.reshape(grid.shape[:2]), region, materials, robot.length, _halved(heights))


def _pieces(robot: Robot) -> list[tuple]:
    """Return (length, inner radius, outer radius, material) of every tube and cap from base to tip."""
    pieces = []
    for segment in robot.segments:
        section = (segment.lumen_diameter / 2, segment.outer_diameter / 2)
        pieces.append((segment.length, *section, segment.material))
        if segment.cap:
            pieces.append((segment.cap.length, *section, segment.cap.material))
    return pieces


def _layers(lengths: list[float], along: int, grading: float) -> tuple[np.ndarray, list[int]]:
    """Return the heights of the layers' ends, graded and fitted to the ends of the pieces, and each layer's piece."""
    if along < len(lengths):
        raise MeshError(f"elements.along is {along}; the robot has {len(lengths)} tubes and caps: at least that many are needed")
    ends = np.concatenate([[0.0], np.cumsum(lengths)])
    sizes = grading ** (np.arange(along) / max(along - 1, 1))
    ideal = np.concatenate([[0.0], np.cumsum(sizes) / sizes.sum()]) * ends[-1]
    index = [0]
    for piece in range(1, len(lengths)):
        nearest = int(np.argmin(np.abs(ideal - ends[piece])))
        index.append(min(max(nearest, index[-1] + 1), along - (len(lengths) - piece)))
    index.append(along)
    heights = np.interp(ideal, ideal[index], ends)
    return heights, [p for p, (a, b) in enumerate(itertools.pairwise(index)) for _ in range(b - a)]


def _radii(pieces: list[tuple], radial: int) -> np.ndarray:
    """Return the radii of the rings: every tube's inner and outer radius, each gap divided into `radial` parts."""
    ends = np.unique(np.round([r for p in pieces for r in p[1:3]], 9))
    return np.concatenate([[ends[0]], *(np.linspace(a, b, radial + 1)[1:] for a, b in itertools.pairwise(ends))])


def _halved(values: np.ndarray) -> np.ndarray:
    """Return the values and the means between them."""
    return np.interp(np.arange(2 * len(values) - 1) / 2.0, np.arange(len(values)), values)


def _kuhn(quadratic: bool) -> list[np.ndarray]:
    """Return the six tetrahedra of a cell, one for each order of the edges on the way from a corner to the opposite one."""
    tets = []
    for order in itertools.permutations(range(3)):
        corners = [np.zeros(3, dtype=int)]
        for axis in order:
            corners.append(corners[-1] + 2 * np.eye(3, dtype=int)[axis])
        if np.linalg.det(np.array(corners[1:]) - corners[0]) < 0:
            corners[1], corners[2] = corners[2], corners[1]
        mids = [(corners[a] + corners[b]) // 2 for a, b in TET_EDGES] if quadratic else []
        tets.append(np.array(corners + mids))
    return tets
