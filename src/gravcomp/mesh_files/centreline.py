"""The axis of a body that is bent at rest: circular arcs fitted to the centroids of its sections."""

import numpy as np

from gravcomp.mesh_files.errors import MeshError
from gravcomp.mesh_files.plane_section import plane_section
from gravcomp.mesh_files.repair_surface import enclosed_volume
from gravcomp.rest_axis import STRAIGHT, Arc, RestAxis, straightened

_PIECES, _SECTIONS, _ROUNDS = 4, 40, 4
# An axis that leaves the straight one by less than this part of the body's thickness, or turns less (rad), counts as straight.
_ASIDE, _TURN = 0.5, np.deg2rad(15.0)
# Weight of a change of curvature from piece to piece, per thickness, against the distance of a centroid.
_SMOOTHNESS = 0.02
# Sections reach so many thicknesses from the axis.
_REACH = 3.0


def fitted_axis(nodes: np.ndarray, triangles: np.ndarray, name: str) -> tuple[RestAxis, float]:
    """Return the axis of the body inside the triangles, which stands on z = 0, and its length along the axis.

    nodes (n, 3) in any unit of length, with z along the axis at the base. Raises MeshError for a body that no such axis runs
    through.
    """
    from scipy.optimize import least_squares

    top = float(nodes[:, 2].max())
    thickness = float(np.sqrt(4.0 * enclosed_volume(nodes, triangles) / (np.pi * top)))
    direction = nodes[np.argmax(np.linalg.norm(nodes, axis=1))]
    length = float(np.linalg.norm(direction))
    upright = _section_places(STRAIGHT, direction, top)
    middles = np.array([plane_section(nodes, triangles, place, normal, _REACH * thickness)[1] for place, normal in upright])
    if np.hypot(middles[:, 0], middles[:, 1]).max() < _ASIDE * thickness and np.hypot(*direction[:2]) < _REACH * thickness:
        return STRAIGHT, top
    # The first sections lie across the line from the base to the farthest point.
    axis, curvature = None, np.zeros((_PIECES, 2))
    for _ in range(_ROUNDS):
        places = _section_places(axis, direction, length)
        found = [plane_section(nodes, triangles, place, normal, _REACH * thickness) for place, normal in places]
        centroids = np.array([centroid for area, centroid in found if area > 0.05 * thickness**2])
        if len(centroids) < _SECTIONS // 2:
            raise MeshError(f"{name}: axis: auto cannot follow the body: it has no sections along a smooth axis")

        def misfit(x: np.ndarray, length: float = length, centroids: np.ndarray = centroids) -> np.ndarray:
            bent = _chain(x.reshape(_PIECES, 2), length)
            aside = straightened(bent, centroids, length)[:, :2]
            changes = np.diff(x.reshape(_PIECES, 2), axis=0) * length**2 / _PIECES
            return np.concatenate([aside.ravel() / thickness, _SMOOTHNESS * changes.ravel() / thickness])

        curvature = least_squares(misfit, curvature.ravel()).x.reshape(_PIECES, 2)
        axis = _chain(curvature, length)
        length = float(straightened(axis, nodes, length)[:, 2].max())
        axis = _chain(curvature, length)
    assert axis is not None  # after the first round
    line, frames = axis.frames(np.linspace(0.0, length, 50))
    turn = float(np.arccos(np.clip(frames[:, 2, 2].min(), -1.0, 1.0)))
    if turn < _TURN or float(np.hypot(line[:, 0], line[:, 1]).max()) < _ASIDE * thickness:
        return STRAIGHT, top
    if float(np.median(np.hypot(*straightened(axis, centroids, length)[:, :2].T))) > thickness:
        raise MeshError(f"{name}: axis: auto cannot follow the body: the middles of its sections lie on no smooth axis")
    return axis, length


def _chain(curvature: np.ndarray, length: float) -> RestAxis:
    """Arcs of equal length with the curvatures (p, 2) towards x and y of their sections."""
    piece = length / len(curvature)
    return RestAxis(tuple(Arc(piece, float(np.hypot(x, y)) * piece, float(np.arctan2(y, x))) for x, y in curvature))


def _section_places(axis: RestAxis | None, direction: np.ndarray, length: float) -> list[tuple[np.ndarray, np.ndarray]]:
    """Points on the axis, or before it is known on the line in `direction`, with the direction there."""
    s = (np.arange(_SECTIONS) + 0.5) / _SECTIONS * length
    if axis is None:
        unit = direction / np.linalg.norm(direction)
        return [(x * unit, unit) for x in s]
    position, rotation = axis.frames(s)
    return list(zip(position, rotation[:, :, 2]))
