"""Figures of one robot's loop: the controller as described, on virtual robots that seeds draw around the description.

The loop runs in one process, in virtual time. Rate and delay of commands belong to the running graph: `demo --json` has them.
"""

import math
from collections.abc import Callable
from typing import Any

from gravcomp.bench import robot_calibration
from gravcomp.closed_loop.setup import Setup
from gravcomp.description import RobotFile, load_robot_file
from gravcomp.trials.holding import unholdable
from gravcomp.trials.similarity import SCALES, similarity
from gravcomp.trials.turning_base import Residuals, residuals

FIGURES = (
    "uncalibrated_pct",
    "moving_pct",
    "held_lateral_mm",
    "moving_lateral_mm",
    "sag_mm",
    "settle_s",
    "unholdable",
    "similarity_pct",
    *robot_calibration.FIGURES,
)
"""Keys of the result."""

SEEDS = (1, 2, 3)
_ORIENTATIONS = 20


def measure(
    file: str, every: int = 1, progress: Callable[[str], None] = lambda _: None, *, calibrated: bool = True
) -> dict[str, Any]:
    """Return the figures of `FIGURES`, the worst over `SEEDS`, and `seeds`: the two shares of each seed.

    Held: at the article's five poses and 20 random orientations of the base; moving: during the turns between them at 30 deg/s.
    every > 1: one seed and so many times fewer random orientations; calibrated: calibrate as well. Raises ConfigError,
    NoEquilibrium and RuntimeError where the loop does not run.
    """
    robot_file = load_robot_file(file)
    runs: dict[int, Residuals] = {}
    calibrations = []
    for seed in SEEDS[:1] if every > 1 else SEEDS:
        setup, count = Setup.of(robot_file, seed), max(1, _ORIENTATIONS // every)
        runs[seed] = residuals(setup, count, progress=_counted(f"{robot_file.robot.name}: loop, seed {seed}", progress))
        progress(f"{robot_file.robot.name}: loop, seed {seed}: held {_pct(runs[seed].held, runs[seed].sag)} % of the sag")
        if calibrated:
            progress(f"{robot_file.robot.name}: calibration, seed {seed}")
            calibrations.append(robot_calibration.measure(setup, count))
    progress(f"{robot_file.robot.name}: whether it can be held")
    shares = {seed: {"held_pct": _pct(run.held, run.sag), "moving_pct": _pct(run.moving, run.sag)} for seed, run in runs.items()}
    return (
        dict.fromkeys(FIGURES)
        | {
            "uncalibrated_pct": max(share["held_pct"] for share in shares.values()),
            "moving_pct": max(share["moving_pct"] for share in shares.values()),
            "held_lateral_mm": round(1e3 * max(run.held for run in runs.values()), 3),
            "moving_lateral_mm": round(1e3 * max(run.moving for run in runs.values()), 3),
            "sag_mm": round(1e3 * min(run.sag for run in runs.values()), 2),
            "settle_s": _worst([run.settled for run in runs.values()]),
            "unholdable": unholdable(robot_file.robot),
            "similarity_pct": similarity_pct(robot_file, every, progress),
            "seeds": {str(seed): share for seed, share in shares.items()},
        }
        | (robot_calibration.worst(calibrations) if calibrations else {})
    )


def similarity_pct(file: RobotFile, every: int, progress: Callable[[str], None]) -> float | None:
    """Return by how many per cent robots of half to four times the size differ at most, see `trials.similarity`.

    None for a body from a file, whose mesh is not scaled.
    """
    if file.robot.body is not None:
        return None
    progress(f"{file.robot.name}: the same robot in other sizes")
    differences = similarity(Setup.of(file, SEEDS[0]), SCALES[-1:] if every > 1 else SCALES)
    return round(100.0 * max(differences.values()), 2)


def _counted(name: str, progress: Callable[[str], None]) -> Callable[[int, int], None]:
    """Return the progress of `residuals` as a text that begins with `name`."""
    return lambda done, total: progress(f"{name} ({done} of {total} orientations)")


def _pct(residual: float, sag: float) -> float:
    return round(100.0 * residual / sag, 2)


def _worst(times: list[float]) -> float | None:
    """The longest time in s; None where one run never settled."""
    return None if any(math.isnan(time) for time in times) else round(max(times), 2)
