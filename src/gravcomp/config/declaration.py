"""Declared parameters: fields of frozen data classes with unit, range and description.

A data class declares each field with `parameter(...)`. Values in the data class are SI. In YAML files and ROS parameters a
field with `edge="mm"` has the key `NAME_mm`, and its value and range are in that unit (the edge unit).

    @dataclass(frozen=True)
    class Tube:
        length: float = parameter(edge="mm", minimum=1, maximum=2000, description="length at rest")
"""

import dataclasses
import functools
import math
import typing
from typing import Any

from gravcomp import __version__

# Edge unit -> (suffix of the key, factor to SI, SI unit).
EDGE_UNITS = {
    "mm": ("_mm", 1e-3, "m"),
    "mm/s": ("_mm_s", 1e-3, "m/s"),
    "um": ("_um", 1e-6, "m"),
    "deg": ("_deg", math.pi / 180.0, "rad"),
    "deg/s": ("_deg_s", math.pi / 180.0, "rad/s"),
    "MPa": ("_mpa", 1e6, "Pa"),
    "ms": ("_ms", 1e-3, "s"),
    "s": ("_s", 1.0, "s"),
    "g": ("_g", 1e-3, "kg"),
}

# Edge unit -> units that are taken for it, with their size in edge units.
_TAKEN_FOR = {"mm": {"cm": 10.0, "m": 1e3}, "mm/s": {"cm/s": 10.0, "m/s": 1e3}, "MPa": {"kPa": 1e-3, "Pa": 1e-6}}


@dataclasses.dataclass(frozen=True)
class Parameter:
    """Declaration of one field. `minimum` and `maximum` are in the edge unit; `renamed_from` is the key's earlier name.

    `accepted_until`: last release, such as "0.2", that takes the earlier name, with a warning.
    """

    description: str
    unit: str = ""
    edge: str | None = None
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple | None = None
    read_only: bool = False
    renamed_from: str | None = None
    accepted_until: str | None = None

    @property
    def accepts_earlier_name(self) -> bool:
        """Whether this release still takes the earlier name."""
        until = self.accepted_until
        return self.renamed_from is not None and until is not None and _release(__version__) <= _release(until)

    @property
    def factor(self) -> float:
        """SI value = factor x edge value."""
        return EDGE_UNITS[self.edge][1] if self.edge else 1.0

    @property
    def suffix(self) -> str:
        """End of the key, such as `_mm`; empty without an edge unit."""
        return EDGE_UNITS[self.edge][0] if self.edge else ""

    @property
    def edge_unit(self) -> str:
        """Unit of the value in YAML files and ROS parameters."""
        return self.edge or self.unit

    def allowed(self) -> str:
        """Return the allowed values in words."""
        if self.choices is not None:
            return "one of " + ", ".join(str(c) for c in self.choices)
        unit = f" {self.edge_unit}" if self.edge_unit else ""
        if self.minimum is not None and self.maximum is not None:
            return f"{self.minimum:g} to {self.maximum:g}{unit}"
        if self.minimum is not None:
            return f"at least {self.minimum:g}{unit}"
        if self.maximum is not None:
            return f"at most {self.maximum:g}{unit}"
        return f"any value{' in' + unit if unit else ''}"

    def likely_units(self, value: float) -> str:
        """Return the units in which a value out of the range would be in it, as words; empty where there is none.

        Only such units as are larger where the value is too small, and smaller where it is too large.
        """
        found = [
            f"{unit}: {size * value:g} {self.edge}"
            for unit, size in _TAKEN_FOR.get(self.edge or "", {}).items()
            if (self.minimum is None or size * value >= self.minimum) and (self.maximum is None or size * value <= self.maximum)
        ]
        return f" (looks like {' or '.join(found)})" if found else ""


def parameter(
    default: Any = dataclasses.MISSING,
    *,
    description: str,
    unit: str = "",
    edge: str | None = None,
    minimum: float | None = None,
    maximum: float | None = None,
    choices: tuple | None = None,
    read_only: bool = False,
    renamed_from: str | None = None,
    accepted_until: str | None = None,
    default_factory: Any = dataclasses.MISSING,
) -> Any:
    """Declare a field of a data class.

    Parameters
    ----------
    default, minimum, maximum
        In the edge unit where there is one, else in SI. A field without a default is required.
    description
        Shown in errors, `--help`, ROS descriptors and the tables of the READMEs.
    unit
        SI unit; not needed with `edge`.
    edge
        Unit in YAML files and ROS parameters, one of EDGE_UNITS.
    choices
        Allowed values.
    read_only
        The ROS parameter cannot be changed while the node runs.
    renamed_from
        Earlier key of this field, with its suffix. It is refused with an error that names the new key.
    accepted_until
        Last release that takes the earlier key, with a warning in place of the error: the next one after the renaming.
    default_factory
        As in `dataclasses.field`, in SI.
    """
    declared = Parameter(
        description,
        unit or (EDGE_UNITS[edge][2] if edge else ""),
        edge,
        minimum,
        maximum,
        choices,
        read_only,
        renamed_from,
        accepted_until,
    )
    metadata = {"parameter": declared}
    if default_factory is not dataclasses.MISSING:
        return dataclasses.field(default_factory=default_factory, metadata=metadata)
    if default is dataclasses.MISSING:
        return dataclasses.field(metadata=metadata)
    return dataclasses.field(default=_scaled(default, declared.factor), metadata=metadata)


def _release(version: str) -> tuple[int, ...]:
    """Return major and minor number of a version."""
    return tuple(int(part) for part in version.split(".")[:2])


def parameter_of(field: dataclasses.Field) -> Parameter | None:
    """Return the declaration of the field, or None for a field that was made without `parameter`."""
    return field.metadata.get("parameter")


@functools.cache
def type_hints(cls: type) -> dict[str, Any]:
    """Return the types of a data class's fields; a node reads its parameters again at every change."""
    return typing.get_type_hints(cls)


def key_of(field: dataclasses.Field) -> str:
    """Return the key of the field in YAML files and ROS parameters."""
    declared = parameter_of(field)
    return field.name + (declared.suffix if declared else "")


def joined(prefix: str, name: Any) -> str:
    """Return the dotted key `prefix.name`."""
    return f"{prefix}.{name}" if prefix else str(name)


def _scaled(value: Any, factor: float) -> Any:
    if factor == 1.0 or value is None or isinstance(value, (str, bool)):
        return value
    if isinstance(value, (list, tuple)):
        return tuple(_scaled(v, factor) for v in value)
    return value * factor
