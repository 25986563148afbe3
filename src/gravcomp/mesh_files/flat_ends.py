"""The flat faces at base and end of a filled body, which a mesher meets only nearly."""

import numpy as np

from gravcomp.mesh_files.repair_volume import boundary_triangles, cell_volumes

# Cosine of the angle by which a triangle of such a face may be turned.
_FLAT = 0.95


def with_flat_ends(nodes: np.ndarray, elements: np.ndarray, length: float, within: float) -> tuple[np.ndarray, np.ndarray]:
    """Return nodes (n, 3) and linear tetrahedra (k, 4), none inverted, with the flat faces at z = 0 and z = length put there.

    within: how far (m) their nodes may be from there.
    """
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
