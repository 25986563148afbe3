"""Conversion between declared data classes and ROS parameters: descriptors, defaults from the robot file, overrides."""

import typing
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node
from rclpy.parameter import Parameter

from gravcomp.config import (
    ConfigError,
    DeclaredParameter,
    check_given,
    convert,
    declared_parameters,
    flattened,
    from_mapping,
)


def declare(node: Node, cls: type, defaults: dict, source: str) -> Any:
    """Declare every leaf of `cls` on the node and return the data class with the overrides applied.

    `defaults`: nested mapping of edge keys from the robot file; `source`: its origin, for error messages.
    Raises ConfigError when a default or an override has the wrong type or is out of range.
    """
    check_given(cls, defaults, source)
    given = flattened(defaults)
    for leaf in declared_parameters(cls):
        override = node._parameter_overrides.get(leaf.key) or _by_earlier_name(node, leaf)
        value = given.get(leaf.key, leaf.default)
        if override is not None:
            # Checked here instead of in rclpy, so that the error states what is allowed, and '1' is accepted for '1.0'.
            value = None if _is_unset(override.value, leaf) else override.value
            convert(value, leaf.type, leaf.parameter, source=f"parameter of {node.get_name()}", key=leaf.key)
        value = _ros_value(value, leaf.type)
        node.declare_parameter(leaf.key, value, _descriptor(leaf, value), ignore_override=True)
    return read(node, cls)


def _by_earlier_name(node: Node, leaf: DeclaredParameter) -> Parameter | None:
    """Return the override of a parameter by its earlier name, where this release still takes it, and warn."""
    override = node._parameter_overrides.get(leaf.earlier_key) if leaf.parameter.accepts_earlier_name else None
    if override is not None:
        node.get_logger().warning(
            f"parameter {leaf.earlier_key} has been renamed; write '{leaf.key}': the earlier name is taken until release"
            f" {leaf.parameter.accepted_until}"
        )
    return override


def refuse_unknown_overrides(node: Node, classes: tuple[type, ...]) -> None:
    """Raise ConfigError for an override of an unknown parameter, which ROS would ignore; `classes`: those declared."""
    earlier = {leaf.earlier_key for cls in classes for leaf in declared_parameters(cls) if leaf.parameter.accepts_earlier_name}
    for name in node._parameter_overrides:
        known = node.has_parameter(name) or name.startswith(("qos_overrides.", "start_type_description_service"))
        known = known or name in earlier
        if not known:
            own = sorted(p for p in node._parameters if not p.startswith(("qos_overrides", "use_sim_time", "start_type")))
            raise ConfigError(f"{node.get_name()}: unknown parameter '{name}'; allowed: {', '.join(own)}")


def read(node: Node, cls: type, changes: list[Parameter] = ()) -> Any:
    """Return the data class with the node's parameters and the `changes`, which are not set yet.

    Raises ConfigError when a value is not allowed.
    """
    changed = {p.name: p.value for p in changes}
    mapping: dict = {}
    for leaf in declared_parameters(cls):
        value = changed[leaf.key] if leaf.key in changed else node.get_parameter(leaf.key).value
        if value is not None and not isinstance(value, (bool, int, float, str)):
            value = list(value)
        if _is_unset(value, leaf):
            value = None
        *path, last = leaf.key.split(".")
        place = mapping
        for step in path:
            place = place.setdefault(step, {})
        if value is not None or leaf.default is None:
            place[last] = value
    return from_mapping(cls, _without_unset(mapping, cls), source=f"parameter of {node.get_name()}")


def _is_unset(value: Any, leaf: DeclaredParameter) -> bool:
    """Return whether an optional parameter is unset: null, which `ros2 param dump` writes, may return as text."""
    return _may_be_unset(leaf) and value in (None, "null", "None")


def _may_be_unset(leaf: DeclaredParameter) -> bool:
    return type(None) in typing.get_args(leaf.type)


def _without_unset(mapping: dict, cls: type) -> dict:
    return {k: _without_unset(v, cls) if isinstance(v, dict) else v for k, v in mapping.items() if v is not None}


def _scalar_type(kind: Any) -> Any:
    arguments = [k for k in typing.get_args(kind) if k not in (type(None), Ellipsis)]
    return arguments[0] if arguments else kind


def _ros_value(value: Any, kind: Any) -> Any:
    """Convert to the types of ROS, which has no tuples and distinguishes 1 from 1.0."""
    scalar = _scalar_type(kind)
    if isinstance(value, (list, tuple)) or hasattr(value, "typecode"):
        return [scalar(v) for v in value]
    if value is None or scalar is bool:
        return value
    return scalar(value)


def _descriptor(leaf: DeclaredParameter, value: Any) -> ParameterDescriptor:
    declared = leaf.parameter
    unit = f" [{declared.edge_unit}]" if declared.edge_unit else ""
    descriptor = ParameterDescriptor(
        description=f"{declared.description}{unit}",
        additional_constraints=f"allowed: {declared.allowed()}",
        read_only=declared.read_only,
        # The type of an unset or empty value is unknown to ROS, so it may change; `read` checks it.
        dynamic_typing=_may_be_unset(leaf) or value == [],
    )
    if leaf.type is float and (declared.minimum is not None or declared.maximum is not None):
        low = -1e308 if declared.minimum is None else float(declared.minimum)
        high = 1e308 if declared.maximum is None else float(declared.maximum)
        descriptor.floating_point_range = [FloatingPointRange(from_value=low, to_value=high, step=0.0)]
    if leaf.type is int and (declared.minimum is not None or declared.maximum is not None):
        low = -(2**63) if declared.minimum is None else int(declared.minimum)
        high = 2**63 - 1 if declared.maximum is None else int(declared.maximum)
        descriptor.integer_range = [IntegerRange(from_value=low, to_value=high, step=0)]
    return descriptor
