"""Parts of the benchmark of the loop: each is one run on one robot, takes minutes, and is kept in the cache when it is finished.

Its place there stands for the robot file with all files that it names, and for the part (`measured_before`).
"""

import dataclasses
import logging
import math
from pathlib import Path
from typing import Any

from gravcomp.bench import robot_calibration
from gravcomp.bench.measured_before import measured_before, place_of
from gravcomp.closed_loop.setup import Setup
from gravcomp.config import ConfigError
from gravcomp.description import RobotFile, load_robot_file
from gravcomp.mesh import MeshError
from gravcomp.trials.holding import unholdable
from gravcomp.trials.similarity import SCALES, similarity
from gravcomp.trials.turning_base import residuals

_ORIENTATIONS = 20


@dataclasses.dataclass(frozen=True)
class Part:
    """One run.

    kind: a key of `KINDS`; file: of the robot; seed: of its virtual robot; every: so many times fewer orientations; again:
    measure also what an earlier run finished.
    """

    kind: str
    file: str
    seed: int = 1
    every: int = 1
    again: bool = False

    @property
    def orientations(self) -> int:
        """Number of random orientations of the base."""
        return max(1, _ORIENTATIONS // self.every)

    @property
    def name(self) -> str:
        """Robot, kind and seed in words."""
        return f"{Path(self.file).stem}: {self.kind}, seed {self.seed}"


def compute(part: Part) -> dict[str, Any]:
    """Return what a part measured, now or in an earlier run; `error`: why the robot could not be measured."""
    path = path_of(part)
    return _outcome(part) if path is None else measured_before(path, lambda: _outcome(part), again=part.again)


def _outcome(part: Part) -> dict[str, Any]:
    """Return the result, or why the robot could not be measured, as `error`."""
    try:
        return KINDS[part.kind](load_robot_file(part.file), part)
    except (ConfigError, MeshError, ArithmeticError, ValueError, RuntimeError) as error:
        logging.getLogger(__name__).warning("%s: %s", part.name, error)
        return {"error": str(error)}


def path_of(part: Part) -> Path | None:
    """Return the path of a part's result in the cache, whose file may not exist yet; None for a file that cannot be read."""
    try:
        contents = _contents(load_robot_file(part.file))
    except ConfigError:
        return None
    return place_of(*contents, part.kind, part.seed, part.every)


def loop(file: RobotFile, part: Part) -> dict[str, Any]:
    """Errors of the loop with the model as described, as shares of the sag; lengths in m."""
    run = residuals(Setup.of(file, part.seed), part.orientations)
    return {
        "held": run.held / run.sag,
        "moving": run.moving / run.sag,
        "held_m": run.held,
        "moving_m": run.moving,
        "sag": run.sag,
        "settled": None if math.isnan(run.settled) else run.settled,
    }


def calibration(file: RobotFile, part: Part) -> dict[str, Any]:
    """The virtual robot calibrated, and held with the calibrated model."""
    return dataclasses.asdict(robot_calibration.measure(Setup.of(file, part.seed), part.orientations))


def other_sizes(file: RobotFile, part: Part) -> dict[str, Any]:
    """Largest difference of robots of half to four times the size as a share, see `trials.similarity`.

    None for a body from a file, whose mesh is not scaled.
    """
    if file.robot.body is not None:
        return {"difference": None}
    differences = similarity(Setup.of(file, part.seed), SCALES[-1:] if part.every > 1 else SCALES)
    return {"difference": max(differences.values()), **differences}


def holding(file: RobotFile, part: Part) -> dict[str, Any]:
    """Why the cables cannot hold the robot straight in some direction of gravity, as a sentence; None: they can."""
    return {"reason": unholdable(file.robot)}


KINDS = {"loop": loop, "calibration": calibration, "similarity": other_sizes, "holdability": holding}
"""What each kind of part runs."""


def _contents(file: RobotFile) -> list[Any]:
    """Return the sections of a robot file, and the contents of all files that they name."""
    found: list[Any] = [file.sections]
    folder = Path(file.source).resolve().parent
    for text in _texts(file.sections):
        path = folder / Path(text).expanduser()
        if path.is_file():
            found.append(path.read_bytes())
    origin = (file.sections.get("virtual_robot") or {}).get("description")
    if origin:
        near = folder / Path(origin).expanduser()
        found += _contents(load_robot_file(near if near.is_file() else origin))
    return found


def _texts(value: Any) -> list[str]:
    """Return the texts among the values of nested mappings and lists."""
    if isinstance(value, dict):
        value = list(value.values())
    if isinstance(value, list):
        return [text for one in value for text in _texts(one)]
    return [value] if isinstance(value, str) else []
