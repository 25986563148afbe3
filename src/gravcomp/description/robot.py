"""The section `robot:` of a robot file as frozen data classes in SI units: body, cables, limits, IMU mount.

Frame `soft_base`: z runs along the straight robot from base to tip; the base is at z = 0.
"""

import dataclasses
import functools
import itertools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from gravcomp.config import parameter
from gravcomp.description.body import Elements, Material
from gravcomp.description.cable import Cable
from gravcomp.description.cable_line import CableLine
from gravcomp.description.cable_path import CableRun, check_crossings, check_path
from gravcomp.description.imu_mount import ImuMount
from gravcomp.description.likely_unit import likely_unit
from gravcomp.description.limits import Limits
from gravcomp.description.max_wrench import MaxWrench
from gravcomp.description.mesh_body import MeshBody
from gravcomp.description.pieces import Piece, piece_at, pieces_of_segments
from gravcomp.description.point_load import PointLoad
from gravcomp.description.segment import Segment

_LONGEST_NAME = 100  # characters; file systems take 255 bytes with what is appended


@dataclasses.dataclass(frozen=True)
class Effectors:
    """Observed and controlled points: the tip and points of the backbone."""

    backbone_points: int = parameter(
        11, minimum=2, maximum=101, description="points of the backbone, evenly from the base (0) to the tip (1)"
    )

    @property
    def backbone_station(self) -> np.ndarray:
        """(n,) stations along the rest length, 0 at the base to 1 at the tip."""
        return np.linspace(0.0, 1.0, self.backbone_points)


@dataclasses.dataclass(frozen=True)
class Payload:
    """A weight that is fixed to the tip, such as a tool."""

    mass: float = parameter(0.0, edge="g", minimum=0.0, maximum=1e5, description="mass at the tip")
    centre: tuple[float, float, float] = parameter(
        (0.0, 0.0, 0.0), edge="mm", minimum=-1000.0, maximum=1000.0,
        description="centre of the mass from the tip, in soft_tip: z along the robot",
    )  # fmt: skip


@dataclasses.dataclass(frozen=True)
class Robot:
    """One robot."""

    name: str = parameter(description="name of the robot")
    segments: tuple[Segment, ...] = parameter((), description="tubes from base to tip")
    body: MeshBody | None = parameter(None, description="a body from a file, instead of segments")
    cables: tuple[Cable, ...] = parameter((), description="cables; their order is the order of every array")
    cable_defaults: CableLine = parameter(
        default_factory=CableLine, description="line of every cable that does not give its own; empty once the cables have it"
    )
    elements: Elements | None = parameter(
        None,
        description="mesh of the segments; chosen by its estimated error when not given",
    )
    effectors: Effectors = parameter(default_factory=Effectors, description="observed points")
    limits: Limits = parameter(default_factory=Limits, description="limits of every cable")
    payload: Payload = parameter(default_factory=Payload, description="weight at the tip")
    loads: tuple[PointLoad, ...] = parameter((), description="weights hung from points of the body")
    max_wrench: MaxWrench | None = parameter(None, description="largest external load; not given: the robot carries none")
    imu_mount: ImuMount = parameter(default_factory=ImuMount, description="mount of the IMU")

    def __post_init__(self) -> None:
        if bool(self.segments) == (self.body is not None):
            found = "both" if self.segments else "neither"
            raise ValueError(f"{found} of segments and body given; exactly one is needed")
        _refuse_name("name", self.name)
        for index, segment in enumerate(self.segments):
            _refuse_name(f"segments[{index}].name", segment.name)
        for index, cable in enumerate(self.cables):
            _refuse_name(f"cables[{index}].name", cable.name)
        _refuse_repeats("segments", [s.name for s in self.segments])
        _refuse_repeats("cables", [c.name for c in self.cables])
        self._fill_cables()
        _ = self.pieces  # refuses segments that do not meet
        segment_names = [s.name for s in self.segments]
        runs = []
        for index, cable in enumerate(self.cables):
            key = f"cables[{index}] ('{cable.name}')"
            if cable.segment is not None and cable.segment not in segment_names:
                allowed = ", ".join(segment_names) or "none (the robot has a body)"
                raise ValueError(f"{key}.segment is '{cable.segment}'; allowed: {allowed}")
            # The checks ask for the same places again and again.
            place = functools.cache(functools.partial(self.cable_place, cable))
            runs.append(CableRun(cable, self.cable_end(cable), place))
            check_path(key, runs[-1], self.pieces, self.segments, self.length, self._unit_hint)
        check_crossings(runs, self.pieces)

    def _unit_hint(self, reached: float) -> str:
        """Return the unit in which the body would be as long as a cable reaches (m), as a sentence; empty where there is none."""
        unit = likely_unit(self.length, reached)
        if unit is None:
            return ""
        name, size = unit
        length = f"{1e3 * size * self.length:.4g} mm long"
        if self.body is None:
            return f"; the segments look like {name}: they would be {length}"
        if self.body.length is not None:
            return f"; body.length_mm looks like {name}: the body would be {length}"
        file_unit = 1e3 * size * self.body.placed().unit
        return f"; the file looks like {name}: with body.file_unit_mm: {file_unit:g} the body is {length}"

    def _fill_cables(self) -> None:
        """Give each cable what `cable_defaults` has and it does not, and empty them: a changed cable is not filled again."""
        object.__setattr__(self, "cables", tuple(cable.filled(self.cable_defaults) for cable in self.cables))
        object.__setattr__(self, "cable_defaults", CableLine())
        for index, cable in enumerate(self.cables):
            try:
                cable.check_stiffness()
            except ValueError as error:
                raise ValueError(f"cables[{index}] ('{cable.name}'): {error}") from error
            if cable.pretension is not None and cable.pretension >= self.limits.tension_max:
                raise ValueError(
                    f"cables[{index}] ('{cable.name}').pretension is {cable.pretension:g} N;"
                    f" allowed: below limits.tension_max = {self.limits.tension_max:g} N"
                )

    @functools.cached_property
    def length(self) -> float:
        """Rest length from base to tip, with caps (m)."""
        return self.body.full_length if self.body else sum(s.full_length for s in self.segments)

    @functools.cached_property
    def pieces(self) -> list[Piece]:
        """The pieces of the segments, from base to tip; none for a body from a file."""
        return pieces_of_segments(self.segments)

    def piece_at(self, s: float) -> Piece:
        """Return the piece at the arc length s (m), the later one where two meet. The robot needs segments."""
        return piece_at(self.pieces, s)

    def cable_place(self, cable: Cable, s: float) -> tuple[float, float]:
        """Return (x, y) in m where the cable crosses the section at the arc length s (m)."""
        x, y = cable.place(s, self.cable_end(cable))
        if not cable.follow_taper:
            return x, y
        across = up = 1.0
        for piece in self.pieces:  # a step in the section does not move the channel
            low, high = max(cable.start, piece.start), min(s, piece.start + piece.length)
            if low < high:
                before, here = piece.section(low)[0], piece.section(high)[0]
                across, up = across * here.half_width / before.half_width, up * here.half_height / before.half_height
        return x * across, y * up

    @property
    def materials(self) -> tuple[Material, ...]:
        """Materials of the segments from base to tip, without caps, or the one of the body from a file."""
        return tuple(segment.material for segment in self.segments) if self.body is None else (self.body.material,)

    @property
    def cable_names(self) -> tuple[str, ...]:
        """Names of the cables in their order."""
        return tuple(c.name for c in self.cables)

    @functools.cached_property
    def _segment_ends(self) -> dict[str, float]:
        """The z (m) of the distal end of each segment by name; the checks of the cables ask for it at each of their points."""
        return dict(zip((s.name for s in self.segments), itertools.accumulate(s.full_length for s in self.segments)))

    def segment_end(self, name: str) -> float:
        """Return z (m) of the distal end of a segment, with its cap."""
        return self._segment_ends[name]

    def cable_end(self, cable: Cable) -> float:
        """Return z (m) where the cable is fixed."""
        if cable.via_points is not None:
            return cable.via_points[-1][2]
        if cable.end is not None:
            return cable.end
        assert cable.segment is not None  # Cable.__post_init__
        return self.segment_end(cable.segment)

    def line_length(self, cable: Cable) -> float:
        """Return the length in m of the cable from capstan to end, with the robot straight."""
        if cable.via_points is not None:
            inside = sum(math.dist(a, b) for a, b in zip(cable.via_points, cable.via_points[1:]))
        else:
            inside = self.cable_end(cable) - cable.start
        return (cable.free_length or 0.0) + inside

    def cable_compliance(self, cable: Cable) -> float:
        """Return the elongation in m/N of the cable from capstan to end under a tension that is the same along it."""
        return self.line_length(cable) / cable.stiffness

    def with_assumed_lines(self) -> "Robot":
        """Return the robot as the loop takes it: with the lines of `CableLine.assumed` where nothing is said of a line.

        An unknown line stretches. With its most probable stretch in the model, only the deviation from it remains as an error.
        """
        cables = tuple(cable.assumed(self.limits.tension_max, self.length) for cable in self.cables)
        return self if cables == self.cables else dataclasses.replace(self, cables=cables)

    def with_material(self, **changes: Any) -> "Robot":
        """Return the robot with these fields of every segment's (or the body's) material changed; caps keep theirs."""
        return self.with_materials([dataclasses.replace(material, **changes) for material in self.materials])

    def with_materials(self, materials: Sequence[Material]) -> "Robot":
        """Return the robot with other materials, in the order of `materials`; caps keep theirs."""
        if self.body is not None:
            return dataclasses.replace(self, body=dataclasses.replace(self.body, material=materials[0]))
        segments = tuple(dataclasses.replace(s, material=material) for s, material in zip(self.segments, materials))
        return dataclasses.replace(self, segments=segments)


def _refuse_name(key: str, name: str) -> None:
    """Raise ValueError for a name that cannot be that of a file, a column of a table or a joint, which are named after it."""
    wrong = "/" in name or "\\" in name or not name.isprintable()
    if wrong or not name or name != name.strip() or name.startswith(".") or len(name) > _LONGEST_NAME:
        found = f"{name[:_LONGEST_NAME]!r}{' and longer' if len(name) > _LONGEST_NAME else ''}"
        raise ValueError(
            f"{key} is {found}, after which files, columns and joints are named; allowed: 1 to {_LONGEST_NAME} characters,"
            " without / and \\ and control characters, without a dot in front and without spaces at the ends"
        )


def _refuse_repeats(what: str, names: Sequence[str]) -> None:
    for name in names:
        if names.count(name) > 1:
            raise ValueError(f"{what}: the name '{name}' is given {names.count(name)} times; names must differ")
