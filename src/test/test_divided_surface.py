"""Long edges of a surface are halved, and its shape stays."""

import numpy as np
import pytest
from mesh_bodies import surface

from gravcomp.mesh_files.divided_surface import with_short_edges
from gravcomp.mesh_files.repair_surface import enclosed_volume
from gravcomp.mesh_files.winding import directed_edges


def angles(nodes: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """The smallest angle (f,) of each triangle in rad."""
    corners = nodes[faces]
    forward, back = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    lengths = np.linalg.norm(forward, axis=2) * np.linalg.norm(back, axis=2)
    return np.arccos((forward * back).sum(axis=2) / lengths).min(axis=1)


@pytest.mark.parametrize("longest", [6.0, 2.5, 1.0])
def test_edges_are_halved_until_they_are_short_enough(longest):
    nodes, faces = surface()
    points, triangles = with_short_edges(nodes, faces, longest)
    edges, count = np.unique(np.sort(directed_edges(triangles), axis=1), axis=0, return_counts=True)
    assert (count == 2).all()  # closed
    assert np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1).max() <= longest
    assert enclosed_volume(points, triangles) == pytest.approx(enclosed_volume(nodes, faces), rel=1e-12)
    assert angles(points, triangles).min() > 0.45 * angles(nodes, faces).min()


def test_short_edges_stay():
    nodes, faces = surface()
    points, triangles = with_short_edges(nodes, faces, 100.0)
    assert np.array_equal(points, nodes) and np.array_equal(triangles, faces)
