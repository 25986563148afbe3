"""The mapping: a small YAML file that says what the columns of a table of measured poses mean.

pose: case                          # column with the names of the poses
gravity: [0, 0, 9.81]               # m/s^2, in the frame of measurement
cables:
  input: tension
  unit: N
  columns: {cable1: tension1_n, cable2: tension2_n}
loads:
  - {at_mm: [15, 0, 100], mass_g: 52}
markers:
  - {name: m1, at_mm: [0, 25, 129.1], unit: mm, columns: [m1_x_mm, m1_y_mm, m1_z_mm]}
fit: [modulus, gain, base]
"""

import dataclasses
from pathlib import Path

from gravcomp.config import ConfigError, from_mapping, load_yaml, parameter
from gravcomp.description import PointLoad

UNITS = {"N": 1.0, "mm": 1e-3, "cm": 1e-2, "m": 1.0, "g": 1e-3, "kg": 1.0}
"""Units of columns, with their factor to SI."""

FITTED = ("modulus", "gain", "gain_per_cable", "zeros", "angles", "tip_radius", "base")
"""What `fit` may contain."""

_LENGTHS = ("mm", "cm", "m")


@dataclasses.dataclass(frozen=True)
class MarkerColumns:
    """One marker: its place at rest, and the columns with its measured place."""

    name: str = parameter(description="name of the marker")
    at: tuple[float, float, float] = parameter(
        edge="mm", minimum=-5000.0, maximum=5000.0, description="place on the robot at rest, in soft_base"
    )
    columns: tuple[str, str, str] = parameter(description="columns with x, y and z")
    unit: str = parameter("mm", choices=_LENGTHS, description="unit of the columns")


@dataclasses.dataclass(frozen=True)
class CableColumns:
    """The columns with what drives the cables."""

    input: str = parameter(choices=("tension", "displacement"), description="what the columns contain")
    unit: str = parameter(choices=("N", *_LENGTHS), description="unit of the columns")
    columns: dict[str, str] = parameter(description="column of each cable of the robot file; cables left out are released")
    sign: int = parameter(1, choices=(1, -1), description="-1: the columns are positive where the cable is paid out")

    def __post_init__(self) -> None:
        if (self.input == "tension") != (self.unit == "N"):
            allowed = "N" if self.input == "tension" else ", ".join(_LENGTHS)
            raise ValueError(f"input is {self.input} and unit is {self.unit}; allowed: {allowed}")


@dataclasses.dataclass(frozen=True)
class MeasuredFrame:
    """The base in the frame of measurement: fixed, or from markers on it in every row."""

    position: tuple[float, float, float] = parameter(
        (0.0, 0.0, 0.0), edge="mm", minimum=-1e5, maximum=1e5, description="origin of soft_base in the frame of measurement"
    )
    rpy: tuple[float, float, float] = parameter(
        (0.0, 0.0, 0.0),
        edge="deg",
        minimum=-360.0,
        maximum=360.0,
        description="orientation of soft_base there, about fixed x, y, z",
    )
    markers: tuple[MarkerColumns, ...] = parameter(
        (), description="at least three markers on the base, instead of position and rpy"
    )

    def __post_init__(self) -> None:
        if self.markers and (any(self.position) or any(self.rpy)):
            raise ValueError("markers are given and also position_mm or rpy_deg; give one of them")
        if 0 < len(self.markers) < 3:
            names = ", ".join(marker.name for marker in self.markers)
            raise ValueError(
                f"{len(self.markers)} markers on the base are given ({names}); a pose needs at least 3, not on one line"
            )


@dataclasses.dataclass(frozen=True)
class MassColumn:
    """A hung weight whose mass differs from row to row."""

    at: tuple[float, float, float] = parameter(
        edge="mm", minimum=-5000.0, maximum=5000.0, description="point of the body at rest, in soft_base"
    )
    column: str = parameter(description="column with the mass")
    unit: str = parameter("g", choices=("g", "kg"), description="unit of the column")


@dataclasses.dataclass(frozen=True)
class Mapping:
    """The meaning of a table's columns."""

    markers: tuple[MarkerColumns, ...] = parameter(description="measured markers")
    gravity: tuple[float, float, float] | None = parameter(
        None, unit="m/s^2", minimum=-100.0, maximum=100.0, description="gravity in the frame of measurement"
    )
    gravity_columns: tuple[str, str, str] | None = parameter(
        None, description="columns with gravity in m/s^2, instead of gravity"
    )
    pose: str = parameter("", description="column with the names of the poses; the number of the line when not given")
    cables: CableColumns | None = parameter(None, description="columns with what drives the cables; none: all are released")
    loads: tuple[PointLoad, ...] = parameter((), description="weights hung on the robot in every row")
    mass_columns: tuple[MassColumn, ...] = parameter((), description="weights hung on the robot, with a mass for each row")
    frame: MeasuredFrame = parameter(default_factory=MeasuredFrame, description="the base in the frame of measurement")
    fit: tuple[str, ...] = parameter(("modulus",), choices=FITTED, description="what is fitted")

    def __post_init__(self) -> None:
        if (self.gravity is None) == (self.gravity_columns is None):
            found = "neither" if self.gravity is None else "both"
            raise ValueError(f"{found} of gravity and gravity_columns given; exactly one is needed")
        if not self.markers:
            raise ValueError("markers is empty; at least one marker is needed")
        names = [marker.name for marker in self.markers]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"markers: the name '{name}' is given {names.count(name)} times; names must differ")
        if not self.fit or len(set(self.fit)) < len(self.fit):
            found = f"'{next(name for name in self.fit if self.fit.count(name) > 1)}' more than once" if self.fit else "nothing"
            raise ValueError(f"fit contains {found}; allowed: one or more of {', '.join(FITTED)}, each once")
        if "base" in self.fit and len(names) < 3:
            raise ValueError(f"fit contains base, whose pose needs at least 3 markers; {len(names)} given ({', '.join(names)})")
        if "gain" in self.fit and "gain_per_cable" in self.fit:
            raise ValueError("fit contains gain and gain_per_cable; give one of them")


def load_mapping(path: str | Path) -> Mapping:
    """Return the mapping in a YAML file. Raises ConfigError."""
    document = load_yaml(path)
    if not isinstance(document, dict):
        raise ConfigError(f"{path}: is not a mapping of keys; needed: markers, gravity and others")
    return from_mapping(Mapping, document, source=str(path))
