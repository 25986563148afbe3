"""Configuration: what is read from YAML or from ROS parameters, checked against declared units and ranges."""

from gravcomp.config.parameters import ConfigError, Parameter, declared_parameters, from_mapping, parameter, to_mapping
from gravcomp.config.yaml_file import load_yaml

__all__ = ["ConfigError", "Parameter", "declared_parameters", "from_mapping", "load_yaml", "parameter", "to_mapping"]
