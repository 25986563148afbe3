"""The section `scene:` of a robot file as frozen data classes in SI units.

Each kind of obstacle has a list of its own. Positions are in the obstacle's frame: `soft_base`, or `world`, whose origin is that
of `soft_base` and whose z axis points up.
"""

import dataclasses

from gravcomp.config import parameter

_Point = tuple[float, float, float]
_RIGID = "wall that yields: force per length of robot and depth; rigid when not given"
_FRAMES = ("soft_base", "world")
_SIDES = ("inside", "outside")
ITSELF = "self"
"""Name of the robot itself as an obstacle."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Wall:
    """What every obstacle has."""

    name: str = parameter("", description="name in messages; kind and number when not given")
    frame: str = parameter("soft_base", choices=_FRAMES, description="frame of its place; an obstacle in the world does not turn")
    friction: float = parameter(0.0, minimum=0.0, maximum=10.0, description="coefficient of Coulomb's friction with the robot")
    stiffness: float | None = parameter(None, edge="MPa", minimum=1e-6, maximum=1e6, description=_RIGID)
    forbidden: bool = parameter(False, description="no wall but a zone: the controller keeps the robot out, nothing pushes it")

    def __post_init__(self) -> None:
        given = [key for key, value in (("friction", self.friction), ("stiffness_mpa", self.stiffness)) if value]
        if self.forbidden and given:
            raise ValueError(f"{given[0]} is given, but a forbidden zone touches nothing; leave it out, or leave out forbidden")


@dataclasses.dataclass(frozen=True, kw_only=True)
class PlaneWall(Wall):
    """A half-space; the robot is on the side to which the normal points."""

    point: _Point = parameter((0.0, 0.0, 0.0), edge="mm", minimum=-1e5, maximum=1e5, description="a point of the plane")
    normal: _Point = parameter((0.0, 0.0, 1.0), minimum=-1e6, maximum=1e6, description="out of the wall, of any length but 0")

    def __post_init__(self) -> None:
        super().__post_init__()
        if not any(self.normal):
            raise ValueError("normal is (0, 0, 0), which is no direction; a vector other than zero is needed")


@dataclasses.dataclass(frozen=True, kw_only=True)
class SphereWall(Wall):
    """A ball, or a hollow in the shape of a ball."""

    centre: _Point = parameter((0.0, 0.0, 0.0), edge="mm", minimum=-1e5, maximum=1e5, description="centre")
    radius: float = parameter(edge="mm", minimum=1e-2, maximum=1e5, description="radius")
    side: str = parameter("outside", choices=_SIDES, description="where the robot is")


@dataclasses.dataclass(frozen=True, kw_only=True)
class BoxWall(Wall):
    """A cuboid, or a hollow in the shape of a cuboid."""

    centre: _Point = parameter((0.0, 0.0, 0.0), edge="mm", minimum=-1e5, maximum=1e5, description="centre")
    size: _Point = parameter(edge="mm", minimum=1e-2, maximum=1e5, description="edge lengths")
    rpy: _Point = parameter(
        (0.0, 0.0, 0.0), edge="deg", minimum=-360.0, maximum=360.0, description="roll, pitch, yaw (fixed axes x, y, z)"
    )
    side: str = parameter("outside", choices=_SIDES, description="where the robot is")


@dataclasses.dataclass(frozen=True, kw_only=True)
class TubeWall(Wall):
    """A tube along a smooth curve through points: a lumen around the robot, or a bent bar next to it."""

    points: tuple[_Point, ...] = parameter(edge="mm", minimum=-1e5, maximum=1e5, description="centre line, in order")
    radius: tuple[float, ...] = parameter(
        edge="mm", minimum=1e-2, maximum=1e5, description="radius at every point, or one for all; smooth between"
    )
    side: str = parameter("inside", choices=_SIDES, description="where the robot is")
    closed: bool = parameter(False, description="a lumen's far end is closed by a half ball; else both ends are open")

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.points) < 2:
            raise ValueError(f"points_mm: {len(self.points)} given; at least 2 are needed")
        if len(self.radius) not in (1, len(self.points)):
            raise ValueError(
                f"radius_mm has {len(self.radius)} entries; 1 or as many as points_mm ({len(self.points)}) are needed"
            )
        for index, (one, other) in enumerate(zip(self.points, self.points[1:])):
            if one == other:
                raise ValueError(f"points_mm[{index}] and points_mm[{index + 1}] are the same; neighbours must differ")


@dataclasses.dataclass(frozen=True, kw_only=True)
class MeshWall(Wall):
    """A solid, or a hollow, inside a closed surface from a file (STL, OBJ, PLY)."""

    file: str = parameter(description="path of the surface, relative to the robot file")
    file_unit: float = parameter(1.0, edge="mm", minimum=1e-6, maximum=1e6, description="length of one unit of the file")
    rotate: _Point = parameter(
        (0.0, 0.0, 0.0),
        edge="deg",
        minimum=-360.0,
        maximum=360.0,
        description="angles about the fixed axes x, y, z in this order",
    )
    move: _Point = parameter((0.0, 0.0, 0.0), edge="mm", minimum=-1e5, maximum=1e5, description="displacement after the rotation")
    side: str = parameter("outside", choices=_SIDES, description="where the robot is")


@dataclasses.dataclass(frozen=True, kw_only=True)
class SceneSection:
    """The section `scene:`: obstacles by kind. Obstacles are numbered in the order of these lists, the robot itself last."""

    planes: tuple[PlaneWall, ...] = parameter((), description="half-spaces")
    spheres: tuple[SphereWall, ...] = parameter((), description="balls")
    boxes: tuple[BoxWall, ...] = parameter((), description="cuboids")
    tubes: tuple[TubeWall, ...] = parameter((), description="tubes along curves")
    meshes: tuple[MeshWall, ...] = parameter((), description="closed surfaces from files")
    self_contact: bool = parameter(False, description="the robot touches itself where it is bent enough; without friction")

    def __post_init__(self) -> None:
        names = [wall.name for wall in self.walls if wall.name]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"the name '{name}' is given {names.count(name)} times; names must differ")
        if self.self_contact and ITSELF in names:
            raise ValueError(f"the name '{ITSELF}' is that of the robot with self_contact; give the obstacle another one")

    @property
    def walls(self) -> tuple[Wall, ...]:
        """All obstacles, in the order of their numbers."""
        return (*self.planes, *self.spheres, *self.boxes, *self.tubes, *self.meshes)
