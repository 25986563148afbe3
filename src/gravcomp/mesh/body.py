"""Mesh of a robot's body: from its tubes, or from a file."""

import numpy as np

from gravcomp.description import MeshBody, Robot
from gravcomp.mesh.mesh import Mesh, MeshError
from gravcomp.mesh.quadratic import raised_to_quadratic
from gravcomp.mesh.refusal import require_well_shaped
from gravcomp.mesh.tube import coarse_elements, tube_mesh
from gravcomp.mesh_files.filling import filled
from gravcomp.rest_axis import straightened

# Relative to the length: distance of a node from the plane of base or tip up to which it is put onto the plane.
_PLANE_TOLERANCE = 1e-4


def body_mesh(robot: Robot) -> Mesh:
    """Return the mesh: graded hexahedra for tubes, quadratic elements for a body from a file. Raises MeshError."""
    if robot.body is not None:
        return _from_file(robot.body)
    mesh = tube_mesh(robot)
    require_well_shaped(robot, robot.elements or coarse_elements(robot), mesh)
    return mesh


def _from_file(body: MeshBody) -> Mesh:
    """Return the mesh of a body from a file. Raises MeshError."""
    placed = body.placed()
    kind, nodes, elements = placed.kind, placed.nodes.copy(), placed.cells
    if kind == "tri3":
        kind = "tet4"
        nodes, elements = filled(nodes, elements, placed.length, body.element_size, body.elements_max, body.file)
    if kind == "tet4":
        kind = "tet10"
        nodes, elements = raised_to_quadratic(nodes, elements)
    length = placed.length
    straight = straightened(placed.axis, nodes, length) if placed.axis.bent else None
    if straight is None:
        nodes[np.abs(nodes[:, 2] - length) < _PLANE_TOLERANCE * length, 2] = length
    stations = np.linspace(0.0, length, max(2, int(np.ceil(length / body.element_size))) + 1)
    region = np.zeros(len(elements), dtype=np.int64)
    mesh = Mesh(kind, nodes, elements, region, (body.material,), length, stations, placed.axis, straight)
    if len(mesh.clamped) < 3:
        raise MeshError(f"{body.file}: no flat base at z = 0: {len(mesh.clamped)} nodes lie there, at least 3 are needed")
    return mesh
