"""A scene ready for computing: the declared obstacles as arrays for compiled functions, in `soft_base`."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from gravcomp.config import ConfigError
from gravcomp.scene.declared import BoxWall, MeshWall, PlaneWall, SceneSection, SphereWall, TubeWall, Wall
from gravcomp.scene.distance import BOX, PLANE, SPHERE, SURFACE, TUBE, SceneArrays, nearest_of_all
from gravcomp.scene.hollow_edges import face_groups
from gravcomp.scene.surface_distance import SurfaceArrays, surface_arrays
from gravcomp.scene.world_axes import world_rotation

_SAMPLES = 9  # places on each piece of a tube from which the nearest one is searched
# Sizes of a surface, as parts of the robot's length, that need no other unit.
_SIZES = 1e-2, 1e2


class Scene:
    """Obstacles around a robot, or the zones that are forbidden to it. It does not change after it is made.

    Attributes: names and walls of the obstacles; arrays: `SceneArrays` in soft_base of the horizontal robot, for compiled
    functions (`distance.nearest`, `distance.gap_to`); in_world (k,): whether a row of them is in the world; self_contact: whether
    the robot touches itself too; source: the file in errors; notes: sentences on what was repaired in files.
    """

    def __init__(self, section: SceneSection, source: str = "scene", forbidden: bool = False):
        """Read the files that the section names; `source`, the robot file, stands in errors, and paths are relative to it.

        forbidden: take the section's forbidden zones in place of its walls. Raises ConfigError: a file that is missing, no
        closed surface, or of a size that another unit would explain.
        """
        self.walls: tuple[Wall, ...] = tuple(wall for wall in section.walls if wall.forbidden == forbidden)
        self.names = tuple(_name(section, wall) for wall in self.walls)
        self.self_contact = section.self_contact and not forbidden
        self.notes: list[str] = []
        self.source = source
        self._rows: list[_Row] = []
        self._pieces: list[np.ndarray] = []
        self._surface = SurfaceArrays.none()
        self._surface_sizes: dict[str, float] = {}
        for number, wall in enumerate(self.walls):
            self._rows += self._made(number, wall)
        self._own = self._arrays()
        self.in_world = np.array([self.walls[row.number].frame == "world" for row in self._rows], dtype=bool)
        self.arrays = self.turned(world_rotation(np.zeros(3)))

    def __bool__(self) -> bool:
        """Whether there are obstacles; the robot itself is one with `self_contact`."""
        return bool(self.walls) or self.self_contact

    def turned(self, rotation: np.ndarray) -> SceneArrays:
        """Return the obstacles in soft_base where `rotation` (3, 3) turns soft_base into the world."""
        if not self.in_world.any():
            return self._own
        turned, origin, inside = self._own.rotation.copy(), self._own.origin.copy(), self.in_world
        turned[inside] = np.asarray(rotation).T @ turned[inside]
        origin[inside] = origin[inside] @ rotation
        return self._own._replace(rotation=turned, origin=origin)

    def under_gravity(self, gravity: np.ndarray) -> SceneArrays:
        """Return the obstacles in soft_base for gravity (3,) there. See `world_axes`."""
        return self.turned(world_rotation(gravity)) if self.in_world.any() else self._own

    def nearest(self, points: np.ndarray, arrays: SceneArrays | None = None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return gap (n,) in m, normal (n, 3) into free space, and number of the nearest obstacle (n,) for points (n, 3).

        Points and normals are in soft_base. arrays: of `turned` or `under_gravity`, default: those of the horizontal robot.
        Without obstacles the gap is infinite and the number -1.
        """
        return nearest_of_all(self.arrays if arrays is None else arrays, np.ascontiguousarray(points, dtype=float).reshape(-1, 3))

    def refuse_other_units(self, length: float) -> None:
        """Raise ConfigError for a surface of a size that does not suit a robot of this length in m, but would in m or mm."""
        for name, size in self._surface_sizes.items():
            wall = self.walls[self.names.index(name)]
            assert isinstance(wall, MeshWall)
            share = size / length
            for unit in (1.0, 1e-3):
                if not _SIZES[0] < share < _SIZES[1] and _SIZES[0] < share * unit / wall.file_unit < _SIZES[1]:
                    raise ConfigError(
                        f"{self.source}: scene.meshes ('{name}').file_unit_mm is {1e3 * wall.file_unit:g}: the surface is"
                        f" {1e3 * size:.3g} mm large, next to a robot of {1e3 * length:g} mm; with file_unit_mm: {1e3 * unit:g}"
                        f" it is {1e3 * size * unit / wall.file_unit:.4g} mm large"
                    )

    def _made(self, number: int, wall: Wall) -> "list[_Row]":
        if isinstance(wall, PlaneWall):
            return [_Row(number, PLANE, turn_to(wall.normal), np.array(wall.point))]
        if isinstance(wall, SphereWall):
            return [_Row(number, SPHERE, np.eye(3), np.array(wall.centre), (wall.radius, 0.0, 0.0), _sign(wall.side))]
        if isinstance(wall, BoxWall):
            return _box_rows(number, wall)
        if isinstance(wall, TubeWall):
            first = len(self._pieces)
            self._pieces += _tube_pieces(wall)
            return [
                _Row(number, TUBE, sign=_sign(wall.side), first=first, last=len(self._pieces), closed=wall.closed),
            ]
        assert isinstance(wall, MeshWall)
        nodes, faces, notes = _read_surface(wall, self.source, f"scene.meshes ('{self.names[number]}')")
        self.notes += [f"{self.names[number]}: {note}" for note in notes]
        self._surface_sizes[self.names[number]] = float(np.ptp(nodes, axis=0).max())
        sign, whole = _sign(wall.side), self._add(nodes, faces)
        row = _Row(number, SURFACE, _rotation(wall.rotate), np.array(wall.move), sign=sign, first=whole, last=-1)
        groups = face_groups(nodes, faces, sign)
        if len(groups) == 1:
            return [row]
        return [dataclasses.replace(row, first=self._add(nodes, faces, chosen), last=whole) for chosen in groups]

    def _add(self, nodes: np.ndarray, faces: np.ndarray, chosen: np.ndarray | None = None) -> int:
        """Add the tree of a surface, or of the chosen ones of its triangles, to those of the scene, and return its root."""
        root = len(self._surface.child)
        self._surface = self._surface.joined(surface_arrays(nodes, faces, chosen))
        return root

    def _arrays(self) -> SceneArrays:
        rows = self._rows
        curve = np.array(self._pieces).reshape(-1, 4, 4)
        share = np.linspace(0.0, 1.0, _SAMPLES)
        samples = np.einsum("sp,cpi->csi", share[:, None] ** np.arange(3, -1, -1), curve)
        walls = [self.walls[row.number] for row in rows]

        def column(values: Sequence, kind: type = float) -> np.ndarray:
            return np.array(values, dtype=kind)

        return SceneArrays(
            obstacle=column([row.number for row in rows], np.int64),
            kind=column([row.kind for row in rows], np.int64),
            rotation=column([row.rotation for row in rows]).reshape(-1, 3, 3),
            origin=column([row.origin for row in rows]).reshape(-1, 3),
            size=column([row.size for row in rows]).reshape(-1, 3),
            sign=column([row.sign for row in rows]),
            first=column([row.first for row in rows], np.int64),
            last=column([row.last for row in rows], np.int64),
            closed=column([row.closed for row in rows], np.bool_),
            stiffness=column([np.inf if wall.stiffness is None else wall.stiffness for wall in walls]),
            friction=column([wall.friction for wall in walls]),
            curve=curve,
            samples=np.ascontiguousarray(samples),
            surface=self._surface,
        )


@dataclasses.dataclass(frozen=True)
class _Row:
    """A row of `SceneArrays`."""

    number: int
    kind: int
    rotation: np.ndarray = dataclasses.field(default_factory=lambda: np.eye(3))
    origin: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros(3))
    size: tuple[float, float, float] = (0.0, 0.0, 0.0)
    sign: float = 1.0
    first: int = 0
    last: int = 0
    closed: bool = False


def _name(section: SceneSection, wall: Wall) -> str:
    for kind, walls in (
        ("plane", section.planes), ("sphere", section.spheres), ("box", section.boxes), ("tube", section.tubes),
        ("mesh", section.meshes),
    ):  # fmt: skip
        for index, other in enumerate(walls):
            if other is wall:
                return wall.name or f"{kind} {index + 1}"
    raise AssertionError("a wall of another section")


def _sign(side: str) -> float:
    return 1.0 if side == "outside" else -1.0


def _rotation(angles: tuple[float, float, float]) -> np.ndarray:
    from scipy.spatial.transform import Rotation

    return Rotation.from_euler("xyz", angles).as_matrix()


def turn_to(normal: Sequence[float] | np.ndarray) -> np.ndarray:
    """Return a rotation (3, 3) whose third column is along the normal (3,), of any length but 0."""
    z = np.array(normal) / np.linalg.norm(normal)
    x = np.eye(3)[np.argmin(np.abs(z))]
    x = x - (x @ z) * z
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def _box_rows(number: int, wall: BoxWall) -> list[_Row]:
    rotation, centre, half = _rotation(wall.rpy), np.array(wall.centre), 0.5 * np.array(wall.size)
    if wall.side == "outside":
        return [_Row(number, BOX, rotation, centre, (half[0], half[1], half[2]))]
    rows = []
    for i in range(3):
        for sign in (1.0, -1.0):
            out = sign * rotation[:, i]
            rows.append(_Row(number, PLANE, turn_to(tuple(-out)), centre + half[i] * out))
    return rows


def _tube_pieces(wall: TubeWall) -> list[np.ndarray]:
    """Coefficients (4, 4) of x, y, z and radius in each piece, by descending powers of the place in it, 0 to 1."""
    from scipy.interpolate import CubicSpline, PchipInterpolator

    points = np.array(wall.points)
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    place = np.concatenate([[0.0], np.cumsum(lengths)])
    radius = np.array(wall.radius if len(wall.radius) > 1 else wall.radius * len(points))
    line, width = CubicSpline(place, points, bc_type="natural").c, PchipInterpolator(place, radius).c
    powers = lengths[:, None, None] ** np.arange(3, -1, -1)[:, None]
    return list(np.dstack([line, width]).swapaxes(0, 1) * powers)


def _read_surface(wall: MeshWall, source: str, key: str) -> tuple[np.ndarray, np.ndarray, tuple[str, ...]]:
    """Return nodes (n, 3) in m, triangles (f, 3) that face outward, and sentences on what was repaired."""
    from gravcomp.mesh_files import MeshError
    from gravcomp.mesh_files.formats import SURFACE_SUFFIXES, TRIANGLES_MAX, read
    from gravcomp.mesh_files.repair_surface import repaired_surface

    path = Path(source).resolve().parent / wall.file
    if path.suffix.lower() not in SURFACE_SUFFIXES:
        raise ConfigError(f"{source}: {key}.file is {wall.file}; allowed formats: {', '.join(SURFACE_SUFFIXES)}")
    try:
        surface = repaired_surface(read(path, TRIANGLES_MAX), path)
    except MeshError as error:
        raise ConfigError(f"{source}: {key}: {error}") from error
    return wall.file_unit * surface.nodes, surface.cells, surface.notes
