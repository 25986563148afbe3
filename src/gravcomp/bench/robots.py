"""Every robot's model in figures, and the model against what others measured and computed.

Of each robot: the error of its mesh, its shape at rest without load, the time of its reduced model's build and step, and the
reduced model's error; or, asked for, the loop on its virtual robot. Robots are computed one after the other, each with an empty
cache; one that fails does not stop the others.
"""

import logging
import os
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from gravcomp.bench import robot_figures, robot_loop, whole_figures
from gravcomp.config import ConfigError
from gravcomp.description import load_robot_file, shipped_robots
from gravcomp.experiments.measured import default_folder
from gravcomp.mesh import MeshError

Progress = Callable[[str], None]


def run(
    progress: Progress, *, files: Sequence[str] = (), figures: Sequence[str] = (), every: int = 1, loop: bool = False
) -> dict:
    """Return `robots`, the figures of `robot_figures.FIGURES` of every robot by name, and the figures of `whole_figures`.

    files: robot files or names of shipped robots; none: all shipped ones, and those in ../shared/robots if that exists. The
    figures of `whole_figures` are computed if no file is given, or if they are asked for. figures: names of the figures wanted,
    none: all; every: compute every `every`-th row and path only; loop: the figures of `robot_loop.FIGURES` in place of all
    others. Raises ConfigError for a figure that does not exist.
    """
    if loop:
        return {"robots": robot_loop.run([str(file) for file in files or _all_files()], figures, progress, every)}
    allowed = [*robot_figures.FIGURES, *whole_figures.FIGURES]
    for name in figures:
        if name not in allowed:
            raise ConfigError(f"--figures has '{name}'; allowed: {', '.join(allowed)}")
    wanted = [name for name in robot_figures.FIGURES if not figures or name in figures]
    result: dict[str, Any] = {"robots": {}}
    if wanted:
        for file in files or _all_files():
            name, measured = _of(str(file), wanted, progress, every)
            result["robots"][name] = measured
    whole = [name for name in whole_figures.FIGURES if name in figures or (not figures and not files)]
    return result | whole_figures.run(progress, whole, every)


def _all_files() -> list[str]:
    """Return the shipped robots, and the robot files next to the measurements of others."""
    folder = default_folder().parent / "robots"
    others = sorted(folder.glob("*.yaml"))
    if not others:
        logging.getLogger(__name__).warning("%s: contains no robot files; only the shipped robots are measured", folder)
    return [*shipped_robots(), *map(str, others)]


def _of(file: str, wanted: Sequence[str], progress: Progress, every: int) -> tuple[str, dict[str, Any]]:
    """Return name and figures of one robot; a figure that fails is None, and `errors` says why."""
    measured: dict[str, Any] = dict.fromkeys(wanted)
    try:
        robot = load_robot_file(file).robot
    except ConfigError as error:
        return Path(file).stem, measured | {"errors": {"file": str(error)}}
    errors: dict[str, str] = {}
    with _empty_cache():
        for name in wanted:
            progress(f"{robot.name}: {robot_figures.FIGURES[name]}")
            try:
                measured |= robot_figures.measure(name, file, every)
            except (ConfigError, MeshError, ArithmeticError, ValueError) as error:
                errors[name] = str(error)
                logging.getLogger(__name__).warning("%s, %s: %s", robot.name, name, error)
    return robot.name, measured | ({"errors": errors} if errors else {})


@contextmanager
def _empty_cache() -> Iterator[None]:
    """Context with an empty cache of its own."""
    before = os.environ.get("GRAVCOMP_CACHE")
    with tempfile.TemporaryDirectory(prefix="gravcomp_bench_") as folder:
        os.environ["GRAVCOMP_CACHE"] = folder
        try:
            yield
        finally:
            if before is None:
                del os.environ["GRAVCOMP_CACHE"]
            else:
                os.environ["GRAVCOMP_CACHE"] = before
