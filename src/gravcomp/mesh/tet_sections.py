"""Cross-sections of meshes of tetrahedra: the polygons in which a plane cuts the elements, with points and areas to integrate.

A body that ends in a rounding has no section at its tip: there the points of the last elements stand for it.
"""

import numpy as np

from gravcomp.mesh.elements import shape_gradients, shape_values, stiffness_quadrature
from gravcomp.mesh.local_coordinates import local_coordinates_from
from gravcomp.mesh.mesh import Mesh, MeshError

# Six points on a triangle, exact for polynomials of degree 4 (Dunavant 1985): barycentric coordinates and weights.
_A, _B = 0.445948490915965, 0.091576213509771
_POINTS = np.array([np.roll((1 - 2 * x, x, x), i) for x in (_A, _B) for i in range(3)])
_WEIGHTS = np.array([0.223381589678011] * 3 + [0.109951743655322] * 3)
# A node this near to the plane, of the length, is taken as off it: sections through nodes have no special cases.
_OFF = 1e-13
# The corner of a tetrahedron in local coordinates.
_CORNERS = np.vstack([np.zeros(3), np.eye(3)])
Points = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


def on_plane(mesh: Mesh, height: float) -> Points:
    """Points of the section at `height` (m along the axis): places (q, 2), areas (q,), nodes and weights (q, c) of each.

    None (q = 0) where the plane does not cut the body.
    """
    straight = mesh.straight[mesh.elements[:, :4], 2]
    slack = 0.5 * mesh.length / max(2, len(mesh.stations))
    near = np.flatnonzero((straight.min(axis=1) <= height + slack) & (straight.max(axis=1) >= height - slack))
    above = straight[near] - height
    if mesh.axis.bent:
        position, rotation = (value[0] for value in mesh.axis.frames(np.array([height])))
        above = (mesh.nodes[mesh.elements[near, :4]] - position) @ rotation[:, 2]
    # At the base the body lies above the plane, everywhere else also below it.
    off_plane = _OFF * mesh.length
    above = np.where(np.abs(above) < off_plane, -off_plane if height < 0.5 * mesh.length else off_plane, above)
    elements, places = _triangles(near, above)
    local = np.einsum("qc,kci->kqi", _POINTS, places).reshape(-1, 3)
    nodes = np.repeat(mesh.elements[elements], len(_POINTS), axis=0)
    weights = shape_values(mesh.kind, local)
    spots = np.einsum("qc,qci->qi", weights, mesh.nodes[nodes])
    corners = np.einsum("kpc,kci->kpi", shape_values("tet4", places), mesh.nodes[mesh.elements[elements][:, :4]])
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    if mesh.axis.bent:
        plane, off = (spots - position) @ rotation[:, :2], (spots - position) @ rotation[:, 2]
    else:
        plane, off = spots[:, :2], spots[:, 2] - height
    areas = np.outer(area, _WEIGHTS).ravel()
    curved = np.abs(off) > 1e-11 * mesh.length
    if curved.any():
        # In an element with curved sides the point is not where it would be in a straight one.
        towards = rotation[:, 2] if mesh.axis.bent else np.array([0.0, 0.0, 1.0])
        wanted = spots[curved] - off[curved, None] * towards
        found, _, reached = local_coordinates_from(
            mesh.kind, mesh.nodes[nodes[curved]], wanted, 1e-12 * mesh.length, local[curved]
        )
        weights[np.flatnonzero(curved)[reached]] = shape_values(mesh.kind, found[reached])
        kept = np.ones(len(plane), dtype=bool)
        kept[np.flatnonzero(curved)[~reached]] = False
        return plane[kept], areas[kept], nodes[kept], weights[kept]
    return plane, areas, nodes, weights


def near_tip(mesh: Mesh) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Points of the elements at the tip: places (q, 3) from the tip in its axes, volumes (q,), nodes and weights (q, c).

    They reach as far below the tip as the body is thick there. Raises MeshError for a mesh too coarse to have them.
    """
    rule = stiffness_quadrature(mesh.kind)
    nodes = mesh.nodes[mesh.elements]
    jacobian = np.einsum("kci,pcj->kpij", nodes, shape_gradients(mesh.kind, rule.points))
    volumes = (np.abs(np.linalg.det(jacobian)) * rule.weights).ravel()
    values = shape_values(mesh.kind, rule.points)
    position, rotation = (value[0] for value in mesh.axis.frames(np.array([mesh.length])))
    places = (np.einsum("pc,kci->kpi", values, nodes).reshape(-1, 3) - position) @ rotation
    # The plane across the axis at the tip may cut a bent body elsewhere too.
    heights = np.repeat(mesh.straight[mesh.elements, 2].min(axis=1), len(rule.points))
    for depth in 0.02 * 1.5 ** np.arange(7) * mesh.length:
        here = (places[:, 2] > -depth) & (heights > 0.5 * mesh.length)
        spread = np.linalg.svd(places[here] - places[here].mean(axis=0), compute_uv=False) if here.sum() >= 16 else np.zeros(3)
        if spread[2] > 0.05 * spread[0]:
            owners = np.repeat(mesh.elements, len(rule.points), axis=0)
            return places[here], volumes[here], owners[here], np.tile(values, (len(mesh.elements), 1))[here]
    raise MeshError("the body has too few elements at its tip to say where the tip is: use smaller elements")


def _triangles(elements: np.ndarray, above: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Triangles in the plane: element (t,) and corners (t, 3, 3) in local coordinates, from the heights (k, 4) of the corners."""
    upper = above > 0.0
    count = upper.sum(axis=1)
    owner, corners = [], []
    for alone in range(4):
        others = [i for i in range(4) if i != alone]
        here = ((count == 1) & upper[:, alone]) | ((count == 3) & ~upper[:, alone])
        owner.append(elements[here])
        corners.append(np.stack([_between(above[here], alone, other) for other in others], axis=1))
    for a, b, c, d in ((0, 1, 2, 3), (0, 2, 1, 3), (0, 3, 1, 2)):
        here = (count == 2) & (upper[:, a] == upper[:, b])
        ring = [_between(above[here], i, j) for i, j in ((a, c), (a, d), (b, d), (b, c))]
        for triangle in ((0, 1, 2), (0, 2, 3)):
            owner.append(elements[here])
            corners.append(np.stack([ring[i] for i in triangle], axis=1))
    return np.concatenate(owner), np.concatenate(corners)


def _between(above: np.ndarray, i: int, j: int) -> np.ndarray:
    """Local coordinates (k, 3) of the point on the edge from corner i to corner j where the plane cuts it."""
    part = (above[:, i] / (above[:, i] - above[:, j]))[:, None]
    return (1.0 - part) * _CORNERS[i] + part * _CORNERS[j]
