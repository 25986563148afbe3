"""Material points inside a mesh, as weights on nodes.

A point X of the body at rest lies in one element at the local coordinates xi with X = sum N_a(xi) X_a, and moves as x = sum
N_a(xi) x_a. Cables and observed sections are attached in this way, so they need no nodes of their own.
"""

import dataclasses

import numpy as np

from gravcomp.mesh.elements import centre, distance_outside, shape_gradients, shape_values
from gravcomp.mesh.mesh import Mesh

# A smaller weight is rounding error of a point on a face, an edge or a node.
_NOTHING = 1e-9


@dataclasses.dataclass(frozen=True)
class Embedding:
    """Points (p, 3) as weights on nodes: nodes (p, c) indices, weights (p, c).

    outside (p,): distance of a point outside its element in local coordinates, zero or less inside.
    """

    nodes: np.ndarray
    weights: np.ndarray
    outside: np.ndarray

    def renumbered(self, order: np.ndarray) -> "Embedding":
        """Return the same points on the mesh renumbered by `order`."""
        rank = np.empty(len(order), dtype=np.int64)
        rank[order] = np.arange(len(order))
        return dataclasses.replace(self, nodes=rank[self.nodes])


def embed(mesh: Mesh, points: np.ndarray) -> Embedding:
    """Attach the points (p, 3) to the mesh; a point outside of it to the nearest of the elements that were tried."""
    points = np.asarray(points, dtype=float).reshape(-1, 3)
    corners = mesh.nodes[mesh.elements]
    low, high = corners.min(axis=1), corners.max(axis=1)
    # A curved side bulges beyond its nodes, and a cable may lie on the surface.
    margin = 0.1 * (high - low).max(axis=1, keepdims=True)
    points_tried, elements_tried = [], []
    for index, point in enumerate(points):
        near = np.flatnonzero(np.all((point >= low - margin) & (point <= high + margin), axis=1))
        if not len(near):
            near = np.array([np.argmin(((corners.mean(axis=1) - point) ** 2).sum(axis=1))])
        points_tried.append(np.full(len(near), index))
        elements_tried.append(near)
    pair_point, pair_element = np.concatenate(points_tried), np.concatenate(elements_tried)
    local = _local_coordinates(mesh, corners[pair_element], points[pair_point])
    distance = distance_outside(mesh.kind, local)
    best = np.full(len(points), -1)
    for pair in np.argsort(-distance, kind="stable"):  # the last one written is the farthest inside
        best[pair_point[pair]] = pair
    weights = shape_values(mesh.kind, local[best])
    weights[np.abs(weights) < _NOTHING] = 0.0
    return Embedding(mesh.elements[pair_element[best]], weights, distance[best])


def _local_coordinates(mesh: Mesh, corners: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return local coordinates (p, 3) of points (p, 3) in elements with the nodes (p, c, 3), by Newton's method."""
    size = np.ptp(mesh.nodes, axis=0).max() / 1000.0
    local = np.tile(centre(mesh.kind), (len(points), 1))
    moving = np.arange(len(points))
    for _ in range(12):
        here, nodes = local[moving], corners[moving]
        misfit = points[moving] - (shape_values(mesh.kind, here)[:, None, :] @ nodes)[:, 0]
        jacobian = nodes.transpose(0, 2, 1) @ shape_gradients(mesh.kind, here)
        # Far outside the element the map may be singular: the step is bounded, and such a pair is not chosen.
        jacobian[np.abs(np.linalg.det(jacobian)) < 1e-12 * size**3] += np.eye(3) * size
        step = np.linalg.solve(jacobian, misfit[..., None])[..., 0]
        local[moving] = here + np.clip(step, -0.5, 0.5)
        # A point far outside stops here: it lies in another element.
        moving = moving[(np.abs(step).max(axis=1) > 1e-12) & (distance_outside(mesh.kind, local[moving]) < 1.0)]
        if not len(moving):
            break
    return local
