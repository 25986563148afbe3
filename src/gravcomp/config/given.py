"""Checking what a mapping gives of a declared data class, without making one."""

from typing import Any

from gravcomp.config.errors import ConfigError
from gravcomp.config.reading import convert, unknown_key
from gravcomp.config.writing import declared_parameters


def check_given(cls: type, mapping: dict, source: str) -> None:
    """Raise ConfigError for unknown keys and values that are not allowed; keys may be missing."""
    leaves = {leaf.key: leaf for leaf in declared_parameters(cls)}
    for key, value in flattened(mapping).items():
        if key not in leaves:
            raise ConfigError(f"{source}: {unknown_key(key, {leaf.key: leaf.earlier_key for leaf in leaves.values()})}")
        convert(value, leaves[key].type, leaves[key].parameter, source=source, key=key)


def flattened(mapping: dict, prefix: str = "") -> dict[str, Any]:
    """Return the values of a nested mapping by their full keys, as `tracker.rate_hz`."""
    flat = {}
    for key, value in (mapping or {}).items():
        here = f"{prefix}.{key}" if prefix else str(key)
        if isinstance(value, dict):
            flat.update(flattened(value, here))
        else:
            flat[here] = value
    return flat
