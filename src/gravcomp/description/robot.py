"""A robot's body, cables, effectors and limits, as frozen data classes in SI units.

Frame `soft_base`: z along the straight robot from base to tip, the base at z = 0. The body is either a row of tubes
(`segments`) or one mesh from a file (`body`). A cable runs parallel to the axis at (r cos phi, r sin phi) from `start`
to the end of its segment, or through explicit via points.
"""

import dataclasses
import math

import numpy as np

from gravcomp.config import parameter


@dataclasses.dataclass(frozen=True)
class Material:
    """An isotropic soft material."""

    law: str = parameter("svk", choices=("svk", "neo_hookean"), description="St. Venant-Kirchhoff, or compressible neo-Hookean")
    youngs_modulus: float = parameter(0.8, edge="MPa", minimum=1e-3, maximum=1e6, description="Young's modulus")
    poissons_ratio: float = parameter(0.45, minimum=0.0, maximum=0.495, description="Poisson's ratio")
    density: float = parameter(1145.0, unit="kg/m^3", minimum=0.0, maximum=30000.0, description="density")
    damping_time: float = parameter(
        20.0, edge="ms", minimum=0.0, maximum=10000.0, description="Kelvin-Voigt: stress of strain rate over stress of strain"
    )
    creep_ratio: float = parameter(
        0.0,
        minimum=0.0,
        maximum=10.0,
        description="stiffness that a load finds at first and that creeps away, over the lasting one; in motion alone",
    )
    creep_time: float = parameter(0.5, unit="s", minimum=1e-3, maximum=1e4, description="in which it creeps away")


@dataclasses.dataclass(frozen=True)
class Cap:
    """A disc of its own material that ends a segment and adds to the robot's length."""

    length: float = parameter(edge="mm", minimum=0.1, maximum=500.0, description="thickness along the axis")
    material: Material = parameter(description="material of the cap")


@dataclasses.dataclass(frozen=True)
class Segment:
    """A tube of constant section."""

    name: str = parameter(description="name, unique in the robot")
    length: float = parameter(edge="mm", minimum=1.0, maximum=5000.0, description="length at rest, without its cap")
    outer_diameter: float = parameter(edge="mm", minimum=0.5, maximum=1000.0, description="outer diameter")
    lumen_diameter: float = parameter(edge="mm", minimum=0.1, maximum=999.0, description="diameter of the working channel")
    material: Material = parameter(default_factory=Material, description="material of the tube")
    cap: Cap | None = parameter(None, description="cap at the distal end")

    def __post_init__(self) -> None:
        if self.lumen_diameter >= 0.98 * self.outer_diameter:
            raise ValueError(
                f"lumen_diameter_mm is {self.lumen_diameter * 1e3:g}; allowed: below 0.98 x outer_diameter_mm"
                f" = {self.outer_diameter * 980:g}"
            )

    @property
    def full_length(self) -> float:
        """Length with the cap."""
        return self.length + (self.cap.length if self.cap else 0.0)


@dataclasses.dataclass(frozen=True)
class MeshBody:
    """A body from a file: a closed surface (.stl, .ply, .obj) to be meshed, or a ready volume mesh (.msh, .vtk, .vtu)."""

    file: str = parameter(description="path of the mesh, relative to the robot's file")
    length: float = parameter(edge="mm", minimum=1.0, maximum=5000.0, description="length along z, to check unit and axis")
    file_unit: float = parameter(1.0, edge="mm", minimum=1e-6, maximum=1e6, description="what one unit of the file is")
    element_size: float = parameter(3.0, edge="mm", minimum=0.05, maximum=500.0, description="edge length to mesh with")
    material: Material = parameter(default_factory=Material, description="material of the body")


@dataclasses.dataclass(frozen=True)
class Elements:
    """How finely tubes are divided into 20-node hexahedra."""

    around: int = parameter(6, minimum=4, maximum=48, description="elements around the axis")
    along: int = parameter(10, minimum=2, maximum=500, description="elements along a robot, shared by length")
    radial: int = parameter(1, minimum=1, maximum=8, description="elements through the wall")
    grading: float = parameter(8.0, minimum=1.0, maximum=50.0, description="ratio of the last element's length to the first's")


@dataclasses.dataclass(frozen=True)
class Cable:
    """A sliding tendon, fixed to the body at its last point and pulled at its first."""

    name: str = parameter(description="name, unique in the robot")
    angle: float | None = parameter(None, edge="deg", minimum=-360.0, maximum=360.0, description="phi about z, from x")
    radius: float | None = parameter(None, edge="mm", minimum=0.0, maximum=500.0, description="pitch radius")
    segment: str | None = parameter(None, description="name of the segment at whose end the cable is fixed")
    start: float = parameter(0.0, edge="mm", minimum=0.0, maximum=50000.0, description="z where the cable enters the body")
    end: float | None = parameter(
        None, edge="mm", minimum=0.0, maximum=50000.0, description="z where the cable is fixed, in place of `segment`"
    )
    via_points: tuple[tuple[float, float, float], ...] | None = parameter(
        None, edge="mm", description="points that the cable slides through, first to last, in place of angle and radius"
    )
    axial_stiffness: float | None = parameter(
        None, unit="N", minimum=1.0, maximum=1e9, description="E A of the cable; inextensible when not given"
    )
    friction: float = parameter(0.0, minimum=0.0, maximum=2.0, description="capstan friction coefficient along the path")

    def __post_init__(self) -> None:
        if self.via_points is not None:
            if self.angle is not None or self.radius is not None or self.segment is not None or self.end is not None:
                raise ValueError(f"cable '{self.name}' has via_points_mm and also angle, radius, segment or end; give one form")
            if len(self.via_points) < 2:
                raise ValueError(f"cable '{self.name}' has {len(self.via_points)} via_points_mm; at least 2 are needed")
            return
        if self.angle is None or self.radius is None:
            raise ValueError(f"cable '{self.name}' needs angle_deg and radius_mm, or via_points_mm")
        if (self.segment is None) == (self.end is None):
            raise ValueError(f"cable '{self.name}' needs one of segment and end_mm")


@dataclasses.dataclass(frozen=True)
class Effectors:
    """What is observed and can be controlled: the tip and points of the backbone."""

    backbone_points: int = parameter(
        11, minimum=2, maximum=101, description="points of the backbone, evenly from the base (0) to the tip (1)"
    )

    @property
    def backbone_station(self) -> np.ndarray:
        """(n,) stations along the rest length, 0 at the base to 1 at the tip."""
        return np.linspace(0.0, 1.0, self.backbone_points)


@dataclasses.dataclass(frozen=True)
class Limits:
    """What the cables may be asked for; the same for every cable."""

    tension_min: float = parameter(0.0, unit="N", minimum=0.0, maximum=1000.0, description="least tension")
    tension_max: float = parameter(5.0, unit="N", minimum=0.001, maximum=1000.0, description="greatest tension")
    displacement_min: float = parameter(-30.0, edge="mm", minimum=-1000.0, maximum=0.0, description="farthest paid out")
    displacement_max: float = parameter(30.0, edge="mm", minimum=0.0, maximum=1000.0, description="farthest pulled in")
    tension_rate: float = parameter(20.0, unit="N/s", minimum=0.001, maximum=1e5, description="greatest change of tension")
    displacement_rate: float = parameter(40.0, edge="mm/s", minimum=0.001, maximum=1e4, description="greatest speed of a cable")

    def __post_init__(self) -> None:
        if self.tension_min >= self.tension_max:
            raise ValueError(f"tension_min is {self.tension_min:g} N; allowed: below tension_max = {self.tension_max:g} N")
        if self.displacement_min >= self.displacement_max:
            raise ValueError("displacement_min_mm and displacement_max_mm are both 0; a cable needs room to move")


@dataclasses.dataclass(frozen=True)
class ImuMount:
    """How the IMU sits on the frame that carries the robot's base."""

    position: tuple[float, float, float] = parameter((0.0, 0.0, 0.0), edge="mm", description="IMU's origin in soft_base")
    rpy: tuple[float, float, float] = parameter(
        (0.0, 0.0, 0.0), edge="deg", description="roll, pitch, yaw of imu_link in soft_base (fixed axes x, y, z)"
    )

    @property
    def rotation(self) -> np.ndarray:
        """(3, 3): vector in soft_base = rotation @ vector in imu_link."""
        (cr, cp, cy), (sr, sp, sy) = np.cos(self.rpy), np.sin(self.rpy)
        return np.array(
            [
                [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
                [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
                [-sp, cp * sr, cp * cr],
            ]
        )


@dataclasses.dataclass(frozen=True)
class Payload:
    """A dead weight carried by the end face."""

    mass: float = parameter(0.0, edge="g", minimum=0.0, maximum=1e5, description="mass at the tip")


@dataclasses.dataclass(frozen=True)
class Robot:
    """One robot."""

    name: str = parameter(description="name of the robot")
    segments: tuple[Segment, ...] = parameter((), description="tubes from base to tip")
    body: MeshBody | None = parameter(None, description="a body from a file, in place of segments")
    cables: tuple[Cable, ...] = parameter((), description="cables; their order is the order of every array")
    elements: Elements = parameter(default_factory=Elements, description="mesh of the tubes")
    effectors: Effectors = parameter(default_factory=Effectors, description="observed points")
    limits: Limits = parameter(default_factory=Limits, description="limits of every cable")
    payload: Payload = parameter(default_factory=Payload, description="weight at the tip")
    imu_mount: ImuMount = parameter(default_factory=ImuMount, description="where the IMU sits")

    def __post_init__(self) -> None:
        if bool(self.segments) == (self.body is not None):
            found = "both" if self.segments else "neither"
            raise ValueError(f"{found} of segments and body given; exactly one is needed")
        _refuse_repeats("segments", [s.name for s in self.segments])
        _refuse_repeats("cables", [c.name for c in self.cables])
        for before, after in zip(self.segments, self.segments[1:]):
            if before.lumen_diameter >= after.outer_diameter or after.lumen_diameter >= before.outer_diameter:
                raise ValueError(f"segments '{before.name}' and '{after.name}' do not touch: one fits into the other's lumen")
        for index, cable in enumerate(self.cables):
            self._check_cable(f"cables[{index}] ('{cable.name}')", cable)

    @property
    def length(self) -> float:
        """Rest length from base to tip, with caps."""
        return self.body.length if self.body else sum(s.full_length for s in self.segments)

    @property
    def cable_names(self) -> tuple[str, ...]:
        return tuple(c.name for c in self.cables)

    def segment_end(self, name: str) -> float:
        """z of a segment's distal end, its cap included."""
        names = [s.name for s in self.segments]
        return sum(s.full_length for s in self.segments[: names.index(name) + 1])

    def cable_end(self, cable: Cable) -> float:
        """z where the cable is fixed."""
        if cable.via_points is not None:
            return cable.via_points[-1][2]
        return cable.end if cable.end is not None else self.segment_end(cable.segment)

    def with_material(self, **changes: float | str) -> "Robot":
        """The same robot with fields of every segment's (or the body's) material changed; caps keep theirs."""
        if self.body is not None:
            material = dataclasses.replace(self.body.material, **changes)
            return dataclasses.replace(self, body=dataclasses.replace(self.body, material=material))
        segments = tuple(dataclasses.replace(s, material=dataclasses.replace(s.material, **changes)) for s in self.segments)
        return dataclasses.replace(self, segments=segments)

    def _check_cable(self, key: str, cable: Cable) -> None:
        names = [s.name for s in self.segments]
        if cable.segment is not None and cable.segment not in names:
            raise ValueError(f"{key}.segment is '{cable.segment}'; allowed: {', '.join(names) or 'none (the robot has a body)'}")
        end = self.cable_end(cable)
        if end > self.length * (1 + 1e-9):
            raise ValueError(f"{key} ends at {end * 1e3:g} mm; allowed: up to the robot's length {self.length * 1e3:g} mm")
        points = cable.via_points
        if points is None:
            if cable.start >= end:
                raise ValueError(f"{key}.start_mm is {cable.start * 1e3:g}; allowed: below its end at {end * 1e3:g}")
            points = [(cable.radius, 0.0, cable.start), (cable.radius, 0.0, end)]
        z = 0.0
        for segment in self.segments:
            low, high = z, z + segment.full_length
            z = high
            for x, y, height in points:
                through = cable.via_points is None and cable.start < high - 1e-9 and end > low + 1e-9
                if not through and not low <= height <= high:
                    continue
                radius = math.hypot(x, y)
                inner, outer = segment.lumen_diameter / 2, segment.outer_diameter / 2
                if not inner <= radius <= outer:
                    raise ValueError(
                        f"{key} runs {radius * 1e3:g} mm from the axis in segment '{segment.name}';"
                        f" allowed: within its wall, {inner * 1e3:g} to {outer * 1e3:g} mm"
                    )


def _refuse_repeats(what: str, names: list[str]) -> None:
    for name in names:
        if names.count(name) > 1:
            raise ValueError(f"{what}: the name '{name}' is given {names.count(name)} times; names must differ")
