"""Every robot's model in figures, and the model against what others measured and computed.

Of each robot: the error of its mesh, its shape at rest without load, the time of its reduced model's build and step, and the
reduced model's error; or, asked for, the loop on its virtual robot. Robots are computed one after the other, each with an empty
cache; one that fails does not stop the others. What was measured before is not measured again (`measured_before`).
"""

import logging
import os
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from gravcomp.bench import robot_figures, robot_loop, whole_figures
from gravcomp.bench.measured_before import measured_before, place_of
from gravcomp.config import ConfigError
from gravcomp.description import load_robot_file, shipped_robots
from gravcomp.experiments.measured import default_folder
from gravcomp.mesh import MeshError

Progress = Callable[[str], None]


def run(
    progress: Progress,
    *,
    files: Sequence[str] = (),
    figures: Sequence[str] = (),
    every: int = 1,
    loop: bool = False,
    mesh: bool = False,
    again: bool = False,
) -> dict:
    """Return `robots`, the figures of `robot_figures.FIGURES` of every robot by name, and the figures of `whole_figures`.

    files: robot files or names of shipped robots; none: all shipped ones, and those in ../shared/robots if that exists. The
    figures of `whole_figures` are computed if no file is given, or if they are asked for. figures: names of the figures wanted,
    none: all; every: compute every `every`-th row and path only; loop: the figures of `robot_loop.FIGURES` in place of all
    others; mesh: those of `robot_figures.OF_THE_MESH`; again: measure the robots' figures again that were measured before.
    Raises ConfigError for a figure that does not exist, and for loop with mesh.
    """
    if loop and mesh:
        raise ConfigError("--loop and --mesh exclude each other: each measures only its own figures")
    if loop:
        return {"robots": robot_loop.run([str(file) for file in files or _all_files()], figures, progress, every, again=again)}
    allowed = list(robot_figures.OF_THE_MESH) if mesh else [*robot_figures.FIGURES, *whole_figures.FIGURES]
    for name in figures:
        if name not in allowed:
            raise ConfigError(f"--figures has '{name}'; allowed: {', '.join(allowed)}")
    wanted = [name for name in robot_figures.FIGURES if name in (figures or allowed)]
    result: dict[str, Any] = {"robots": {}}
    if wanted:
        chosen = list(files or _all_files())
        for number, file in enumerate(chosen, start=1):

            def show(stage: str, number: int = number) -> None:
                progress(f"robot {number} of {len(chosen)}, {stage}")

            name, measured = _of(str(file), wanted, show, every, again)
            result["robots"][name] = measured
    whole = [name for name in whole_figures.FIGURES if name in figures or (not figures and not files and not mesh)]
    return result | whole_figures.run(progress, whole, every)


def _all_files() -> list[str]:
    """Return the shipped robots, and the robot files next to the measurements of others."""
    folder = default_folder().parent / "robots"
    others = sorted(folder.glob("*.yaml"))
    if not others:
        logging.getLogger(__name__).warning("%s: contains no robot files; only the shipped robots are measured", folder)
    return [*shipped_robots(), *map(str, others)]


def _of(file: str, wanted: Sequence[str], progress: Progress, every: int, again: bool) -> tuple[str, dict[str, Any]]:
    """Return name and figures of one robot; a figure that fails is None, and `errors` says why."""
    measured: dict[str, Any] = dict.fromkeys(wanted)
    try:
        robot = load_robot_file(file).robot
    except ConfigError as error:
        return Path(file).stem, measured | {"errors": {"file": str(error)}}
    errors: dict[str, str] = {}
    with tempfile.TemporaryDirectory(prefix="gravcomp_bench_") as folder:
        for name in wanted:
            if measured[name] is not None:  # the same computation as that of another figure gave it
                continue
            what = f"{robot.name}: {robot_figures.FIGURES[name]}"
            progress(what)

            def outcome(name: str = name, what: str = what) -> dict[str, Any]:
                with _cache(folder):
                    return _outcome(name, file, every, lambda stage: progress(f"{what}, {stage}"))

            body = Path(robot.body.file).read_bytes() if robot.body is not None else b""
            found = measured_before(place_of(robot, body, name, every), outcome, again=again)
            if "error" in found:
                errors[name] = found["error"]
                logging.getLogger(__name__).warning("%s, %s: %s", robot.name, name, found["error"])
            else:
                measured |= found
    return robot.name, measured | ({"errors": errors} if errors else {})


def _outcome(name: str, file: str, every: int, progress: Progress) -> dict[str, Any]:
    """Return the figure, or why it could not be measured, as `error`."""
    try:
        return robot_figures.measure(name, file, every, progress)
    except (ConfigError, MeshError, ArithmeticError, ValueError) as error:
        return {"error": str(error)}


@contextmanager
def _cache(folder: str) -> Iterator[None]:
    """Context in which the cache is in the folder."""
    before = os.environ.get("GRAVCOMP_CACHE")
    os.environ["GRAVCOMP_CACHE"] = folder
    try:
        yield
    finally:
        if before is None:
            del os.environ["GRAVCOMP_CACHE"]
        else:
            os.environ["GRAVCOMP_CACHE"] = before
