"""URDF from the xacro files that the ROS packages install."""

import os
from pathlib import Path

from gravcomp.config import ConfigError


def shipped_xacro(name: str) -> Path:
    """Return `share/gravcomp_fem/urdf/NAME` in the first prefix of AMENT_PREFIX_PATH that has it. Raises ConfigError."""
    for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(":"):
        path = Path(prefix) / "share" / "gravcomp_fem" / "urdf" / name
        if prefix and path.exists():
            return path
    raise ConfigError(f"no share/gravcomp_fem/urdf/{name} in any of AMENT_PREFIX_PATH: is the workspace built?")


def expanded(path: Path, **arguments: str) -> str:
    """Return the URDF from a xacro file and its arguments. Raises ConfigError when xacro fails."""
    import xacro

    try:
        return xacro.process_file(str(path), mappings=arguments).toprettyxml(indent="  ")
    except Exception as error:  # xacro raises whatever its expressions raise
        raise ConfigError(f"{path}: {error}") from error
