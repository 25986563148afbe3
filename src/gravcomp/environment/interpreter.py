"""Choose the Python interpreter, and the ROS, of the environment."""

import os
import shutil
import subprocess
import sys
from dataclasses import dataclass

from gravcomp.environment.errors import SetupError

SUPPORTED = ((3, 11), (3, 12), (3, 13))
_PROBE = """
import importlib.util, json, os, platform, sys, sysconfig
print(json.dumps(dict(
    version=list(sys.version_info[:2]),
    ensurepip=importlib.util.find_spec("ensurepip") is not None,
    headers=os.path.exists(os.path.join(sysconfig.get_paths()["include"], "Python.h")),
    rclpy=importlib.util.find_spec("rclpy") is not None,
    machine=platform.machine(), system=platform.system())))
"""


@dataclass(frozen=True)
class Interpreter:
    """A Python that the environment can be built on. `ros`: prefix of a sourced ROS 2 Jazzy, or '' for the wheels."""

    path: str
    version: tuple
    ensurepip: bool
    headers: bool
    ros: str


def choose_interpreter() -> Interpreter:
    """Return the sourced ROS's Python, or without a ROS the first supported Python. Raises SetupError."""
    if os.environ.get("ROS_DISTRO"):
        return _of_sourced_ros()
    # Not the environment's own Python when it is active: that environment may be about to be replaced.
    own = sys.executable if sys.prefix == sys.base_prefix else getattr(sys, "_base_executable", "")
    candidates = [own] + [shutil.which(f"python{a}.{b}") for a, b in reversed(SUPPORTED)]
    tried = []
    for path in candidates:
        found = path and _probe(path)
        if not found:
            continue
        tried.append("{}.{}".format(*found["version"]))
        if tuple(found["version"]) in SUPPORTED:
            if (found["system"], found["machine"]) != ("Linux", "x86_64"):
                raise SetupError(
                    f"this is {found['system']} on {found['machine']}; the ROS wheels are for Linux on x86_64. "
                    "With a sourced ROS 2 Jazzy that one is used instead."
                )
            return Interpreter(path, tuple(found["version"]), found["ensurepip"], found["headers"], "")
    raise SetupError(
        f"Python 3.11, 3.12 or 3.13 is needed; found {', '.join(tried) or 'none'}. "
        "On Debian 12 or Ubuntu 24.04: apt-get install python3"
    )


def _of_sourced_ros() -> Interpreter:
    distro = os.environ["ROS_DISTRO"]
    if distro != "jazzy":
        raise SetupError(f"the sourced ROS is '{distro}'; 'jazzy' is needed, or none (then the wheels from PyPI are used)")
    prefix = os.environ.get("AMENT_PREFIX_PATH", "").split(":")[-1]
    path = shutil.which("python3")
    found = _probe(path) if path else None
    if not path or not found or not found["rclpy"]:
        raise SetupError(
            "ROS_DISTRO is 'jazzy' but python3 finds no rclpy: source /opt/ros/jazzy/setup.bash again, or unset ROS_DISTRO"
        )
    return Interpreter(path, tuple(found["version"]), found["ensurepip"], found["headers"], prefix)


def _probe(path: str) -> "dict | None":
    import json

    try:
        answer = subprocess.run([path, "-c", _PROBE], capture_output=True, text=True, timeout=30)
        return json.loads(answer.stdout) if answer.returncode == 0 else None
    except (OSError, ValueError, subprocess.TimeoutExpired):
        return None
