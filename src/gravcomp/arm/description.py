"""URDF from files, and from the xacro files that the ROS packages install."""

import os
from pathlib import Path

from gravcomp.config import ConfigError


def read_urdf(path: str | Path) -> str:
    """Return the text of a URDF file. Raises ConfigError when it cannot be read."""
    try:
        return Path(path).expanduser().read_text(encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}; the path of a URDF file is needed") from error
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: is not a UTF-8 text file; the path of a URDF file is needed") from error


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
