"""Reading a mapping of edge keys (from YAML or ROS parameters) into a declared data class, with checks.

from_mapping(Tube, {"length_mm": 50}, source="robot.yaml")   # Tube(length=0.05)
"""

import contextlib
import dataclasses
import difflib
import math
import types
import typing
import warnings
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, TypeVar

from gravcomp.config.declaration import Parameter, joined, key_of, parameter_of, type_hints
from gravcomp.config.errors import ConfigError

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

T = TypeVar("T", bound="DataclassInstance")


def from_mapping(cls: type[T], mapping: Any, *, source: str, key: str = "") -> T:
    """Build the data class `cls` from a mapping of edge keys.

    `source` (name of a file or node) and `key` (dotted path of the mapping) appear in the errors.
    Raises ConfigError for an unknown, renamed or missing key, and for a value of the wrong type or out of range.
    """
    mapping = {} if mapping is None else mapping
    if not isinstance(mapping, dict):
        raise ConfigError(f"{source}: {key or 'the document'} is {_show(mapping)}; a mapping of keys is needed")
    mapping = _with_present_names(cls, mapping, source, key)
    hints = type_hints(cls)
    fields = {key_of(f): f for f in dataclasses.fields(cls) if f.init}
    for name in mapping:
        if name not in fields:
            earlier = {current: declared.renamed_from for current, f in fields.items() if (declared := parameter_of(f))}
            raise ConfigError(f"{source}: {unknown_key(name, dict.fromkeys(fields) | earlier, key)}")
    values = {}
    for name, field in fields.items():
        here, declared = joined(key, name), parameter_of(field)
        if name in mapping:
            values[field.name] = convert(mapping[name], hints[field.name], declared, source=source, key=here)
        elif field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING:
            meaning = f" ({declared.description}; allowed: {declared.allowed()})" if declared else ""
            raise ConfigError(f"{source}: key '{here}' is missing{meaning}")
    try:
        return cls(**values)
    except ConfigError:
        raise
    except ValueError as error:  # a check of several fields in the data class's __post_init__
        raise ConfigError(f"{source}: {key}: {error}" if key else f"{source}: {error}") from error


def _with_present_names(cls: type, mapping: dict, source: str, key: str) -> dict:
    """Return the mapping with the present names of keys whose earlier ones are still taken, and warn of each."""
    for field in dataclasses.fields(cls):
        declared = parameter_of(field)
        if declared is None or not declared.accepts_earlier_name or declared.renamed_from not in mapping:
            continue
        if key_of(field) in mapping:
            raise ConfigError(
                f"{source}: '{joined(key, declared.renamed_from)}' and its new name '{key_of(field)}' are both given"
            )
        warnings.warn(
            f"{source}: key '{joined(key, declared.renamed_from)}' has been renamed; write '{key_of(field)}': the earlier name is"
            f" taken until release {declared.accepted_until}",
            FutureWarning,
            stacklevel=3,
        )
        mapping = {key_of(field) if name == declared.renamed_from else name: value for name, value in mapping.items()}
    return mapping


def convert(value: Any, kind: Any, declared: Parameter | None, *, source: str, key: str) -> Any:
    """Check one edge value and convert it to the SI value of type `kind`.

    A single number or string stands for a list with it, where a list of any length is declared.
    Raises ConfigError, with `source` and `key`, when the type is wrong or the value is out of range.
    """
    declared = declared or Parameter("")
    origin = typing.get_origin(kind)
    if origin in (typing.Union, types.UnionType):
        if value is None:
            return None
        member = next(k for k in typing.get_args(kind) if k is not type(None))
        return convert(value, member, declared, source=source, key=key)
    if isinstance(kind, type) and dataclasses.is_dataclass(kind):
        return from_mapping(kind, value, source=source, key=key)
    if origin is tuple:
        members = typing.get_args(kind)
        any_length = len(members) == 2 and members[1] is Ellipsis
        if any_length and members[0] in (float, int, str) and isinstance(value, (float, int, str)):  # one for all
            return (convert(value, members[0], declared, source=source, key=key),)
        if not isinstance(value, (list, tuple)):
            raise ConfigError(f"{source}: {key} is {_show(value)}; a list is needed")
        if any_length:
            members = (members[0],) * len(value)
        if len(members) != len(value):
            raise ConfigError(f"{source}: {key} has {len(value)} entries; {len(members)} are needed")
        return tuple(convert(v, k, declared, source=source, key=f"{key}[{i}]") for i, (v, k) in enumerate(zip(value, members)))
    if origin is dict:
        if not isinstance(value, dict):
            raise ConfigError(f"{source}: {key} is {_show(value)}; a mapping is needed")
        member = typing.get_args(kind)[1]
        return {str(k): convert(v, member, declared, source=source, key=joined(key, k)) for k, v in value.items()}
    return _scalar(value, kind, declared, source=source, key=key)


def unknown_key(name: Any, allowed: Mapping[str, str | None], key: str = "") -> str:
    """Return the sentence for a key `name` of the mapping at `key` that is not allowed.

    `allowed` maps the allowed keys to their earlier names (None: never renamed).
    """
    for current, earlier in allowed.items():
        if earlier is not None and name == earlier:
            return f"key '{joined(key, name)}' has been renamed; write '{current}' instead"
    near = difflib.get_close_matches(str(name), allowed, n=1)
    hint = f" (did you mean '{near[0]}'?)" if near else ""
    return f"unknown key '{joined(key, name)}'{hint}; allowed: {', '.join(sorted(allowed))}"


def _scalar(value: Any, kind: type, declared: Parameter, *, source: str, key: str) -> Any:
    if kind is float and isinstance(value, str):
        with contextlib.suppress(ValueError):  # YAML 1.1 reads '1e-3' as a string, but the user means the number
            value = float(value)
    right_type = {
        bool: isinstance(value, bool),
        int: isinstance(value, int) and not isinstance(value, bool),
        float: isinstance(value, (int, float)) and not isinstance(value, bool),
        str: isinstance(value, str),
    }.get(kind, True)
    if not right_type:
        name = {bool: "true or false", int: "a whole number", float: "a number", str: "a string"}[kind]
        raise ConfigError(f"{source}: {key} is {_show(value)}; {name} is needed ({declared.allowed()})")
    if kind is float:
        value = float(value)
        if not math.isfinite(value):
            raise ConfigError(f"{source}: {key} is {value}; a finite number is needed ({declared.allowed()})")
    below = declared.minimum is not None and kind in (int, float) and value < declared.minimum
    above = declared.maximum is not None and kind in (int, float) and value > declared.maximum
    if below or above or (declared.choices is not None and value not in declared.choices):
        likely = declared.likely_units(value) if below or above else ""
        raise ConfigError(f"{source}: {key} is {_show(value)}; allowed: {declared.allowed()}{likely}")
    return value * declared.factor if kind is float else value


def _show(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
