"""A mesh with each of its quadratic elements divided into eight, on the same surface."""

import dataclasses

import numpy as np

from gravcomp.mesh.elements import reference_nodes, shape_values
from gravcomp.mesh.mesh import Mesh
from gravcomp.mesh.quadratic import TET_EDGES
from gravcomp.mesh_files.welding import welded

# Local coordinates of the nodes of a tetrahedron, in the order of VTK.
_CORNERS = np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)])
_NODES = np.vstack([_CORNERS, _CORNERS[TET_EDGES].mean(axis=1)])
# Four tetrahedra at the corners, and the octahedron between them, divided along its diagonal from node 6 to node 8.
_PARTS = np.array(
    [
        *((0, 4, 6, 7), (4, 1, 5, 8), (6, 5, 2, 9), (7, 8, 9, 3)),
        *((6, 8, 4, 5), (6, 8, 5, 9), (6, 8, 9, 7), (6, 8, 7, 4)),
    ]
)


def refined(mesh: Mesh) -> Mesh:
    """Return a mesh of kind tet10 or hex20 with elements half as large each way.

    The new nodes lie where the elements of `mesh` have these local coordinates, so the surface is the same, curved or not, and
    the shapes of `mesh` are shapes of the refined mesh, too.
    """
    if mesh.kind == "hex20":
        return _refined_hexahedra(mesh)
    if mesh.kind != "tet10":
        raise ValueError(f"the mesh is of kind {mesh.kind}; allowed: tet10, hex20")
    # The nodes of the parts by their local coordinates; a new one is halfway between two nodes of the element.
    edges = np.sort(_PARTS[:, TET_EDGES].reshape(-1, 2), axis=1)
    pairs, place = np.unique(edges, axis=0, return_inverse=True)
    values = shape_values("tet10", _NODES[pairs].mean(axis=1))
    ends = np.sort(mesh.elements[:, pairs], axis=2).reshape(-1, 2)
    _, first, number = np.unique(ends, axis=0, return_index=True, return_inverse=True)
    number = number.reshape(len(mesh.elements), len(pairs)) + len(mesh.nodes)

    def carried(places: np.ndarray) -> np.ndarray:
        new = np.einsum("mc,kci->kmi", values, places[mesh.elements]).reshape(-1, 3)
        return np.vstack([places, new[first]])

    corners = mesh.elements[:, _PARTS]
    middles = number[:, place].reshape(len(mesh.elements), len(_PARTS), len(TET_EDGES))
    return dataclasses.replace(
        mesh,
        nodes=carried(mesh.nodes),
        elements=np.concatenate([corners, middles], axis=2).reshape(-1, 10),
        region=np.repeat(mesh.region, len(_PARTS)),
        straight_nodes=None if mesh.straight_nodes is None else carried(mesh.straight_nodes),
    )


def _refined_hexahedra(mesh: Mesh) -> Mesh:
    """Return a mesh of kind hex20 with elements half as large each way."""
    corners = reference_nodes("hex20")
    values = shape_values("hex20", (0.5 * (corners[None, :] + corners[:8, None])).reshape(-1, 3))
    bent = mesh.straight_nodes is not None
    places = np.hstack([mesh.nodes, mesh.straight]) if bent else mesh.nodes
    new = np.einsum("mc,kci->kmi", values, places[mesh.elements]).reshape(-1, places.shape[1])
    nodes, elements, _ = welded(new, np.arange(len(new)).reshape(-1, len(corners)))
    return dataclasses.replace(
        mesh,
        nodes=nodes[:, :3],
        elements=elements,
        region=np.repeat(mesh.region, 8),
        straight_nodes=nodes[:, 3:] if bent else None,
    )
