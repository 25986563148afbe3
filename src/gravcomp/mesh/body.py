"""Mesh of a robot's body: from its tubes, or from a file."""

from pathlib import Path

import numpy as np

from gravcomp.description import MeshBody, Robot
from gravcomp.mesh.mesh import Mesh, MeshError
from gravcomp.mesh.refusal import require_well_shaped
from gravcomp.mesh.surface_file import SURFACE_SUFFIXES, mesh_surface
from gravcomp.mesh.tube import coarse_elements, tube_mesh
from gravcomp.mesh.volume_file import VOLUME_SUFFIXES, read_volume

# Relative to the length: difference between the file's length and length_mm, and distance of a node from the plane of base or
# tip.
_LENGTH_TOLERANCE, _PLANE_TOLERANCE = 0.02, 1e-4


def body_mesh(robot: Robot) -> Mesh:
    """Return the mesh: graded hexahedra for tubes, quadratic tetrahedra for a body from a file. Raises MeshError."""
    if robot.body is not None:
        return _from_file(robot.body)
    mesh = tube_mesh(robot)
    require_well_shaped(robot, robot.elements or coarse_elements(robot), mesh)
    return mesh


def _from_file(body: MeshBody) -> Mesh:
    """Return the mesh of a body from a file. Raises MeshError."""
    path = Path(body.file)
    if not path.is_file():
        raise MeshError(f"{path}: the file of the body's mesh does not exist")
    if path.suffix.lower() in SURFACE_SUFFIXES:
        kind, nodes, elements = mesh_surface(str(path), body.element_size / body.file_unit)
    elif path.suffix.lower() in VOLUME_SUFFIXES:
        kind, nodes, elements = read_volume(str(path))
    else:
        raise MeshError(f"{path}: allowed are surfaces {SURFACE_SUFFIXES} and volume meshes {VOLUME_SUFFIXES}")
    nodes = nodes * body.file_unit
    _check_place(path, nodes, body)
    for plane in (0.0, body.length):
        nodes[np.abs(nodes[:, 2] - plane) < _PLANE_TOLERANCE * body.length, 2] = plane
    stations = np.linspace(0.0, body.length, max(2, int(np.ceil(body.length / body.element_size))) + 1)
    region = np.zeros(len(elements), dtype=np.int64)
    mesh = Mesh(kind, nodes, elements, region, (body.material,), body.length, stations)
    for name, found in (("base at z = 0", mesh.clamped), (f"end face at z = {body.length * 1e3:g} mm", mesh.tip)):
        if len(found) < 3:
            raise MeshError(f"{path}: no flat {name}: {len(found)} nodes lie there, at least 3 are needed")
    return mesh


def _check_place(path: Path, nodes: np.ndarray, body: MeshBody) -> None:
    """Raise MeshError unless the body stands on z = 0 with its declared length along z."""
    low, high = nodes.min(axis=0), nodes.max(axis=0)
    size = high - low
    found = f"the body is {size[0] * 1e3:.4g} x {size[1] * 1e3:.4g} x {size[2] * 1e3:.4g} mm, from z = {low[2] * 1e3:.4g} mm"
    if abs(size[2] - body.length) > _LENGTH_TOLERANCE * body.length:
        hint = "its axis is not z" if np.any(np.abs(size[:2] - body.length) < 0.02 * body.length) else "check file_unit_mm"
        raise MeshError(f"{path}: {found}; length_mm says {body.length * 1e3:g} along z ({hint})")
    if abs(low[2]) > _PLANE_TOLERANCE * body.length:
        raise MeshError(f"{path}: {found}; the base must lie at z = 0")
