"""A body from a file at its place: read, repaired, in metres, in the frame `soft_base`."""

import dataclasses
import functools
import logging
from pathlib import Path

import numpy as np

from gravcomp.mesh_files import formats
from gravcomp.mesh_files.centreline import fitted_axis
from gravcomp.mesh_files.errors import MeshError
from gravcomp.mesh_files.orientation import automatic_frame
from gravcomp.mesh_files.repair_surface import repaired_surface
from gravcomp.mesh_files.repair_volume import boundary_triangles, repaired_volume
from gravcomp.mesh_files.units import unit_of
from gravcomp.rest_axis import STRAIGHT, RestAxis, straightened

# Of the length: how far a node may lie from the plane of the base or of the end face to be put onto it.
_PLANE = 1e-4
# A body this much wider than it is long along z probably lies on its side.
_LYING = 1.5
_WAYS = "axis: auto finds axis and base; transform turns and moves the body"


@dataclasses.dataclass(frozen=True)
class Placement:
    """How a body is put into soft_base.

    axis: 'given' (the file's z, after the transform), 'auto' or 'auto_reversed'; unit and length in m, None: to be found;
    scale, rotate (rad, about the fixed axes x, y, z in this order) and move (m) act in this order, after the axis is found.
    """

    axis: str = "given"
    unit: float | None = None
    length: float | None = None
    scale: float = 1.0
    rotate: tuple[float, float, float] = (0.0, 0.0, 0.0)
    move: tuple[float, float, float] = (0.0, 0.0, 0.0)
    elements_max: int = 20_000


@dataclasses.dataclass(frozen=True, eq=False)
class PlacedBody:
    """A surface (kind tri3, facing outward) or a volume (tet4, tet10, hex20) in soft_base.

    nodes (n, 3) in m; cells (k, c); length in m along the axis at rest `axis`; unit: of the file, in m, with the reason and the
    length in words; notes: sentences on what was found and repaired.
    """

    kind: str
    nodes: np.ndarray
    cells: np.ndarray
    length: float
    axis: RestAxis
    unit: float
    unit_reason: str
    notes: tuple[str, ...]

    @functools.cached_property
    def straight_surface(self) -> np.ndarray:
        """The triangles (t, 3, 3) around the straightened body, facing outward; faces of quadratic elements count as flat."""
        nodes = straightened(self.axis, self.nodes, self.length) if self.axis.bent else self.nodes
        return nodes[self.cells if self.kind == "tri3" else boundary_triangles(self.cells)]

    @functools.cached_property
    def without_elements(self) -> "PlacedBody":
        """The surface of the body, flat between the corners of its elements."""
        if self.kind == "tri3":
            return self
        used, triangles = np.unique(boundary_triangles(self.cells), return_inverse=True)
        return dataclasses.replace(self, kind="tri3", nodes=self.nodes[used], cells=triangles.reshape(-1, 3))


def placed_body(path: str | Path, placement: Placement) -> PlacedBody:
    """Return the body in the file at its place. Raises MeshError when it cannot be read, repaired or placed."""
    path = Path(path)
    state = path.stat() if path.is_file() else None
    return _placed(path, state and (state.st_mtime_ns, state.st_size), placement)


@functools.lru_cache(maxsize=4)
def _placed(path: Path, _: object, placement: Placement) -> PlacedBody:
    name = str(path)
    raw = formats.read(path, placement.elements_max)
    if raw.is_surface:
        mesh = repaired_surface(raw, path)
        triangles = mesh.cells
    else:
        if len(raw.cells) > placement.elements_max:
            raise formats.too_many(path, f"has {len(raw.cells)} elements", placement.elements_max)
        mesh = repaired_volume(raw, name)
        triangles = boundary_triangles(mesh.cells)
    if mesh.kind == "tet4":
        mesh = mesh.with_notes("linear tetrahedra lock in bending: they are raised to quadratic ones with straight sides")
    for note in mesh.notes:
        logging.getLogger(__name__).warning("%s: %s", name, note)
    notes = [*mesh.notes]
    nodes, clamped = mesh.nodes, False
    if placement.axis != "given":
        frame = automatic_frame(nodes, triangles, placement.axis == "auto_reversed", name)
        nodes = (nodes - frame.origin) @ frame.rotation.T
        nodes[frame.face, 2] = 0.0  # the face may be flat only nearly
        notes += frame.notes
        clamped = frame.clamped > 0.0
    nodes = placement.scale * nodes @ _rotation(placement.rotate).T
    axis, length = STRAIGHT, float(np.ptp(nodes[:, 2]))
    if placement.axis != "given" and not any(placement.rotate[:2]):
        axis, length = fitted_axis(nodes, triangles, name)
    if axis.bent:
        turn = np.degrees(np.arccos(axis.frames(np.array([length]))[1][0, 2, 2]))
        notes.append(f"the body is bent at rest: its axis turns by {turn:.0f} deg; lengths run along it")
    unit, why = _unit(mesh.unit, nodes, length, placement, name)
    why = f"{why}: {length * unit * 1e3:.6g} mm long"
    notes.append(why)
    if axis.bent and any(placement.move):
        raise MeshError(f"{name}: transform.move_mm cannot move a body that is bent at rest: its axis begins inside its base")
    nodes, length = unit * nodes + np.array(placement.move), unit * length
    axis = RestAxis(tuple(dataclasses.replace(arc, length=unit * arc.length) for arc in axis.arcs))
    if placement.length is not None and not axis.bent:
        nodes[:, 2] *= placement.length / length  # rounding of the declared length
        length = placement.length
    if not clamped:
        _check_base(nodes, length, name)
    for plane in (0.0, length) if not axis.bent else (0.0,):
        nodes[np.abs(nodes[:, 2] - plane) < _PLANE * length, 2] = plane
    return PlacedBody(mesh.kind, nodes, mesh.cells, length, axis, unit, why, tuple(notes))


def _unit(fixed: float | None, nodes: np.ndarray, length: float, placement: Placement, name: str) -> tuple[float, str]:
    """The unit, and why it is that one; a body that lies on its side is named before its unit is doubted. Raises MeshError."""
    size = np.ptp(nodes, axis=0)
    lying = placement.axis == "given" and max(size[:2]) > _LYING * size[2]
    across = "xy"[int(np.argmax(size[:2]))]
    on_side = MeshError(
        f"{name}: the body is {' x '.join(f'{x:.4g}' for x in size)} units: its axis is not z but nearer to {across}; {_WAYS}"
    )
    if lying and placement.length is None:
        raise on_side
    try:
        return unit_of(length, placement.unit, fixed, placement.length, name)
    except MeshError as error:
        raise (on_side if lying else error) from None


def _rotation(angles: tuple[float, float, float]) -> np.ndarray:
    """Rotation (3, 3) about the fixed axes x, y, z in this order."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_euler("xyz", angles).as_matrix()


def _check_base(nodes: np.ndarray, length: float, name: str) -> None:
    """Raise MeshError unless the body stands on z = 0 on a flat face."""
    low, size = nodes.min(axis=0), np.ptp(nodes, axis=0)
    found = f"the body is {' x '.join(f'{1e3 * x:.4g}' for x in size)} mm, from z = {1e3 * low[2]:.4g} mm"
    if abs(low[2]) > _PLANE * length:
        raise MeshError(f"{name}: {found}; the base must lie at z = 0; {_WAYS}")
    base = nodes[np.abs(nodes[:, 2]) < _PLANE * length]
    if len(base) < 3 or np.linalg.svd(base - base.mean(axis=0), compute_uv=False)[1] < 1e-3 * length:
        raise MeshError(f"{name}: {found}; no flat base at z = 0: {len(base)} nodes lie there, at least 3 around it; {_WAYS}")
