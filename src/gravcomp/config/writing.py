"""From a declared data class to edge keys and edge units: as a mapping for YAML, or as a list of its parameters."""

import dataclasses
import functools
from typing import TYPE_CHECKING, Any

from gravcomp.config.declaration import Parameter, joined, key_of, parameter_of, type_hints

if TYPE_CHECKING:
    from _typeshed import DataclassInstance


@dataclasses.dataclass(frozen=True)
class DeclaredParameter:
    """One parameter with its dotted key, its type, and its default in the edge unit (None: no default)."""

    key: str
    type: Any
    default: Any
    parameter: Parameter

    @property
    def earlier_key(self) -> str | None:
        """Dotted key before the parameter was renamed, or None."""
        prefix, earlier = self.key.rpartition(".")[0], self.parameter.renamed_from
        return None if earlier is None else joined(prefix, earlier)


def to_mapping(value: "DataclassInstance") -> dict:
    """Return the inverse of `from_mapping`: edge keys, edge units and plain types, ready for YAML."""
    result = {}
    for field in dataclasses.fields(value):
        if not field.init:
            continue
        declared = parameter_of(field)
        result[key_of(field)] = _plain(getattr(value, field.name), declared.factor if declared else 1.0)
    return result


def declared_parameters(cls: "type[DataclassInstance]") -> list[DeclaredParameter]:
    """Return every parameter of a data class; those of nested data classes have dotted keys."""
    return list(_declared(cls, ""))


@functools.cache
def _declared(cls: "type[DataclassInstance]", prefix: str) -> tuple[DeclaredParameter, ...]:
    hints = type_hints(cls)
    leaves: list[DeclaredParameter] = []
    for field in dataclasses.fields(cls):
        if not field.init:
            continue
        here = joined(prefix, key_of(field))
        kind = hints[field.name]
        declared = parameter_of(field) or Parameter("")
        if isinstance(kind, type) and dataclasses.is_dataclass(kind):
            leaves += _declared(kind, here)
            continue
        default = field.default
        if field.default_factory is not dataclasses.MISSING:
            default = field.default_factory()
        default = None if default is dataclasses.MISSING else _plain(default, declared.factor)
        leaves.append(DeclaredParameter(here, kind, default, declared))
    return tuple(leaves)


def _plain(value: Any, factor: float) -> Any:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return to_mapping(value)
    if isinstance(value, (list, tuple)):
        return [_plain(v, factor) for v in value]
    if isinstance(value, dict):
        return {k: _plain(v, factor) for k, v in value.items()}
    if isinstance(value, float) and factor != 1.0:
        # Twelve digits remove the rounding error of the conversion: 0.05 m is 50 mm, not 50.00000000000001.
        return float(f"{value / factor:.12g}")
    return value
