"""Mesh of a robot's body: from its segments, or from a file."""

import numpy as np

from gravcomp.description import MeshBody, Robot
from gravcomp.mesh.division import divided_mesh, why_not_swept
from gravcomp.mesh.elements import edges
from gravcomp.mesh.mesh import Mesh, MeshError
from gravcomp.mesh.quadratic import raised_to_quadratic
from gravcomp.mesh.refusal import require_well_shaped
from gravcomp.mesh.tube import coarse_elements
from gravcomp.mesh_files.filling import filled, size_of_elements
from gravcomp.mesh_files.repair_surface import enclosed_volume
from gravcomp.rest_axis import straightened

# Relative to the length: distance of a node from the plane of base or tip up to which it is put onto the plane.
_PLANE_TOLERANCE = 1e-4
# How many elements fill a surface whose file gives no size of them.
_FEW = 1000


def body_mesh(robot: Robot) -> Mesh:
    """Return the mesh: hexahedra in layers for segments, and for a body from a file of a robot with `elements`.

    Without, a body from a file has quadratic elements: those of the file, or tetrahedra in a surface. Raises MeshError.
    """
    if robot.body is not None and robot.elements is None:
        return _from_file(robot.body)
    reason = why_not_swept(robot)
    if reason is not None:
        raise MeshError(
            f"the body in {robot.body.file if robot.body else ''} cannot be divided into `elements` along its axis: {reason}."
            " Leave `elements` out: then it has tetrahedra"
        )
    elements = robot.elements or coarse_elements(robot)
    mesh = divided_mesh(robot, elements)
    require_well_shaped(robot, elements, mesh)
    return mesh


def first_size(body: MeshBody) -> float:
    """Return an edge length (m) with which about a thousand elements fill the surface of a file. Raises MeshError."""
    placed = body.placed()
    return size_of_elements(enclosed_volume(placed.nodes, placed.cells), min(_FEW, body.elements_max))


def _from_file(body: MeshBody) -> Mesh:
    """Return the mesh of a body from a file. Raises MeshError."""
    placed = body.placed()
    kind, nodes, elements = placed.kind, placed.nodes.copy(), placed.cells
    size = body.element_size
    if kind == "tri3":
        kind = "tet4"
        size = size or first_size(body)
        nodes, elements = filled(nodes, elements, placed.length, size, body.elements_max, body.file)
    if kind == "tet4":
        kind = "tet10"
        nodes, elements = raised_to_quadratic(nodes, elements)
    if size is None:
        size = float(np.linalg.norm(np.diff(nodes[elements[:, edges(kind)]], axis=2), axis=-1).mean())
    length = placed.length
    straight = straightened(placed.axis, nodes, length) if placed.axis.bent else None
    if straight is None:
        nodes[np.abs(nodes[:, 2] - length) < _PLANE_TOLERANCE * length, 2] = length
    stations = np.linspace(0.0, length, max(2, int(np.ceil(length / size))) + 1)
    region = np.zeros(len(elements), dtype=np.int64)
    mesh = Mesh(kind, nodes, elements, region, (body.material,), length, stations, placed.axis, straight)
    if len(mesh.clamped) < 3:
        raise MeshError(f"{body.file}: no flat base at z = 0: {len(mesh.clamped)} nodes lie there, at least 3 are needed")
    return mesh
