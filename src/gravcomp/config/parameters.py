"""Declared parameters: frozen data classes whose fields know their unit, range and meaning.

A data class declares each field with `parameter(...)`. Inside, values are SI. At the edge (YAML, ROS parameters) a
field with `edge="mm"` is written `NAME_mm` and its range is given in that unit; `from_mapping` converts and checks.

    @dataclass(frozen=True)
    class Tube:
        length: float = parameter(edge="mm", minimum=1, maximum=2000, description="length at rest")

    from_mapping(Tube, {"length_mm": 50}, source="robot.yaml")   # Tube(length=0.05)
"""

import dataclasses
import difflib
import math
import types
import typing
from typing import Any

# Edge unit -> (suffix of the key, factor to SI, SI unit).
EDGE_UNITS = {
    "mm": ("_mm", 1e-3, "m"),
    "mm/s": ("_mm_s", 1e-3, "m/s"),
    "um": ("_um", 1e-6, "m"),
    "deg": ("_deg", math.pi / 180.0, "rad"),
    "deg/s": ("_deg_s", math.pi / 180.0, "rad/s"),
    "MPa": ("_mpa", 1e6, "Pa"),
    "ms": ("_ms", 1e-3, "s"),
    "g": ("_g", 1e-3, "kg"),
}


class ConfigError(ValueError):
    """A configuration value that is missing, unknown, of the wrong type or out of range; the text is for people."""


@dataclasses.dataclass(frozen=True)
class Parameter:
    """What a field declares of itself; `minimum`, `maximum` and `default` are in the edge unit."""

    description: str
    unit: str = ""
    edge: str | None = None
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple | None = None
    read_only: bool = False

    @property
    def factor(self) -> float:
        """SI value = factor x edge value."""
        return EDGE_UNITS[self.edge][1] if self.edge else 1.0

    @property
    def suffix(self) -> str:
        return EDGE_UNITS[self.edge][0] if self.edge else ""

    @property
    def edge_unit(self) -> str:
        """The unit that people read and type."""
        return self.edge or self.unit

    def allowed(self) -> str:
        """The allowed values in words."""
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


@dataclasses.dataclass(frozen=True)
class DeclaredParameter:
    """One leaf of a data class as seen from the edge: its dotted key there, its type, and its default there."""

    key: str
    type: Any
    default: Any
    parameter: Parameter


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
    default_factory: Any = dataclasses.MISSING,
) -> Any:
    """Declare a field. `default`, `minimum` and `maximum` are in the edge unit where there is one (SI otherwise)."""
    declared = Parameter(description, unit or (EDGE_UNITS[edge][2] if edge else ""), edge, minimum, maximum, choices, read_only)
    metadata = {"parameter": declared}
    if default_factory is not dataclasses.MISSING:
        return dataclasses.field(default_factory=default_factory, metadata=metadata)
    if default is dataclasses.MISSING:
        return dataclasses.field(metadata=metadata)
    return dataclasses.field(default=_scale(default, declared.factor), metadata=metadata)


def key_of(field: dataclasses.Field) -> str:
    """The field's key at the edge."""
    declared = field.metadata.get("parameter")
    return field.name + (declared.suffix if declared else "")


def from_mapping(cls: type, mapping: Any, *, source: str, key: str = "") -> Any:
    """Build the data class `cls` from a mapping of edge keys.

    `source` (a file's or node's name) and `key` (the dotted path so far) go into the errors.
    Raises ConfigError for unknown, missing, mistyped and out-of-range values.
    """
    mapping = {} if mapping is None else mapping
    if not isinstance(mapping, dict):
        raise ConfigError(f"{source}: {key or 'the document'} is {_show(mapping)}; a mapping of keys is needed")
    hints = typing.get_type_hints(cls)
    fields = {key_of(f): f for f in dataclasses.fields(cls) if f.init}
    for name in mapping:
        if name not in fields:
            near = difflib.get_close_matches(str(name), fields, n=1)
            hint = f" (did you mean '{near[0]}'?)" if near else ""
            raise ConfigError(f"{source}: unknown key '{_join(key, name)}'{hint}; allowed: {', '.join(sorted(fields))}")
    values = {}
    for name, field in fields.items():
        here = _join(key, name)
        if name in mapping:
            values[field.name] = convert(
                mapping[name], hints[field.name], field.metadata.get("parameter"), source=source, key=here
            )
        elif field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING:
            declared = field.metadata.get("parameter")
            meaning = f" ({declared.description}; allowed: {declared.allowed()})" if declared else ""
            raise ConfigError(f"{source}: key '{here}' is missing{meaning}")
    try:
        return cls(**values)
    except ConfigError:
        raise
    except ValueError as error:  # a data class's own cross-check in __post_init__
        raise ConfigError(f"{source}: {key or cls.__name__}: {error}") from error


def to_mapping(value: Any) -> dict:
    """The inverse of `from_mapping`: edge keys and edge units, plain types, ready for YAML."""
    result = {}
    for field in dataclasses.fields(value):
        if not field.init:
            continue
        declared = field.metadata.get("parameter")
        result[key_of(field)] = _plain(getattr(value, field.name), declared.factor if declared else 1.0)
    return result


def declared_parameters(cls: type, prefix: str = "") -> list[DeclaredParameter]:
    """Every leaf parameter of a data class, nested ones with dotted keys, with edge defaults (None: no default)."""
    hints = typing.get_type_hints(cls)
    leaves = []
    for field in dataclasses.fields(cls):
        if not field.init:
            continue
        here = _join(prefix, key_of(field))
        kind = hints[field.name]
        declared = field.metadata.get("parameter") or Parameter("")
        if dataclasses.is_dataclass(kind):
            leaves += declared_parameters(kind, here)
            continue
        default = field.default
        if field.default_factory is not dataclasses.MISSING:
            default = field.default_factory()
        default = None if default is dataclasses.MISSING else _plain(default, declared.factor)
        leaves.append(DeclaredParameter(here, kind, default, declared))
    return leaves


def convert(value: Any, kind: Any, declared: Parameter | None, *, source: str, key: str) -> Any:
    """One edge value checked and converted to the SI value of type `kind`."""
    declared = declared or Parameter("")
    origin = typing.get_origin(kind)
    if origin in (typing.Union, types.UnionType):
        members = [k for k in typing.get_args(kind) if k is not type(None)]
        if value is None:
            return None
        return convert(value, members[0], declared, source=source, key=key)
    if dataclasses.is_dataclass(kind):
        return from_mapping(kind, value, source=source, key=key)
    if origin is tuple:
        if not isinstance(value, (list, tuple)):
            raise ConfigError(f"{source}: {key} is {_show(value)}; a list is needed")
        members = typing.get_args(kind)
        if len(members) == 2 and members[1] is Ellipsis:
            members = (members[0],) * len(value)
        if len(members) != len(value):
            raise ConfigError(f"{source}: {key} has {len(value)} entries; {len(members)} are needed")
        return tuple(convert(v, k, declared, source=source, key=f"{key}[{i}]") for i, (v, k) in enumerate(zip(value, members)))
    if origin is dict:
        if not isinstance(value, dict):
            raise ConfigError(f"{source}: {key} is {_show(value)}; a mapping is needed")
        member = typing.get_args(kind)[1]
        return {str(k): convert(v, member, declared, source=source, key=_join(key, k)) for k, v in value.items()}
    return _scalar(value, kind, declared, source=source, key=key)


def _scalar(value: Any, kind: type, declared: Parameter, *, source: str, key: str) -> Any:
    if kind is float and isinstance(value, str):
        # YAML 1.1 reads '1e-3' as text; a person means the number.
        try:
            value = float(value)
        except ValueError:
            pass
    right_type = {
        bool: isinstance(value, bool),
        int: isinstance(value, int) and not isinstance(value, bool),
        float: isinstance(value, (int, float)) and not isinstance(value, bool),
        str: isinstance(value, str),
    }.get(kind, True)
    if not right_type:
        name = {bool: "true or false", int: "a whole number", float: "a number", str: "a text"}[kind]
        raise ConfigError(f"{source}: {key} is {_show(value)}; {name} is needed ({declared.allowed()})")
    if kind is float:
        value = float(value)
        if not math.isfinite(value):
            raise ConfigError(f"{source}: {key} is {value}; a finite number is needed ({declared.allowed()})")
    below = declared.minimum is not None and kind in (int, float) and value < declared.minimum
    above = declared.maximum is not None and kind in (int, float) and value > declared.maximum
    if below or above or (declared.choices is not None and value not in declared.choices):
        raise ConfigError(f"{source}: {key} is {_show(value)}; allowed: {declared.allowed()}")
    return value * declared.factor if kind is float else value


def _scale(value: Any, factor: float) -> Any:
    if factor == 1.0 or value is None or isinstance(value, (str, bool)):
        return value
    if isinstance(value, (list, tuple)):
        return tuple(_scale(v, factor) for v in value)
    return value * factor


def _plain(value: Any, factor: float) -> Any:
    if dataclasses.is_dataclass(value):
        return to_mapping(value)
    if isinstance(value, (list, tuple)):
        return [_plain(v, factor) for v in value]
    if isinstance(value, dict):
        return {k: _plain(v, factor) for k, v in value.items()}
    if isinstance(value, float) and factor != 1.0:
        # Twelve digits take the rounding of the conversion away again: 0.05 m is 50 mm, not 50.00000000000001.
        return float(f"{value / factor:.12g}")
    return value


def _join(prefix: str, name: Any) -> str:
    return f"{prefix}.{name}" if prefix else str(name)


def _show(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
