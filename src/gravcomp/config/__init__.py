"""Configuration from YAML files and ROS parameters, checked against declared units and ranges."""

from gravcomp.config.declaration import Parameter, parameter
from gravcomp.config.errors import ConfigError
from gravcomp.config.given import check_given, flattened
from gravcomp.config.reading import convert, from_mapping, unknown_key
from gravcomp.config.writing import DeclaredParameter, declared_parameters, to_mapping
from gravcomp.config.yaml_file import load_yaml, parse_yaml

__all__ = [
    "ConfigError",
    "DeclaredParameter",
    "Parameter",
    "check_given",
    "convert",
    "declared_parameters",
    "flattened",
    "from_mapping",
    "load_yaml",
    "parameter",
    "parse_yaml",
    "to_mapping",
    "unknown_key",
]
