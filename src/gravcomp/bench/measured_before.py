"""What a benchmark of robots has measured before, kept under the content of robot and program.

A figure is measured again when the robot, a mesh that its file names, or the source of the core has changed. So a benchmark that
was interrupted goes on where it stopped.
"""

import json
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import gravcomp
from gravcomp.cache import cache_path, content_key
from gravcomp.description import Robot

_FORMAT = 1
_PACKAGES = (
    "bench", "cables", "config", "contact", "description", "full_model", "inverse", "materials", "mechanics", "mesh",
    "mesh_files", "reduction", "scene", "simulation", "training",
)  # fmt: skip
"""Packages whose source counts, and so do the modules that are in none."""


def measured_before(
    robot: Robot, figure: str, every: int, measure: Callable[[], dict[str, Any]], *, again: bool
) -> dict[str, Any]:
    """Return what `measure` returned for this figure of the robot, or measure and keep it; again: measure in any case."""
    body = Path(robot.body.file).read_bytes() if robot.body is not None else b""
    path = cache_path("bench", content_key(_FORMAT, robot, body, figure, every, _source()), ".json")
    if path.exists() and not again:
        known: dict[str, Any] = json.loads(path.read_text())
        return known
    found = measure()
    if "error" in found:  # it may lie in something that the key does not contain, as an installed library
        return found
    part = path.with_suffix(".part")
    part.write_text(json.dumps(found))
    part.replace(path)
    return found


@cache
def _source() -> str:
    """Return the key of the core's source, as far as figures depend on it."""
    root = Path(gravcomp.__file__).parent
    files = sorted([*root.glob("*.py"), *(path for name in _PACKAGES for path in (root / name).rglob("*.py"))])
    return content_key(*(path.read_bytes() for path in files))
