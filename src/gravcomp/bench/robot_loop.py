"""Figures of the loop on robots: the controller as described and calibrated, on virtual robots that seeds draw around them.

The loop runs in one process, in virtual time. Rate and delay of commands belong to the running graph: `demo --json` has them.
"""

import dataclasses
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from gravcomp.bench import robot_calibration
from gravcomp.bench.robot_calibration import Calibrated
from gravcomp.bench.robot_parts import Part, compute, path_of
from gravcomp.config import ConfigError
from gravcomp.description import load_robot_file
from gravcomp.sweep import Sweep

_OF_LOOP = (
    "uncalibrated_pct", "uncalibrated_moving_pct", "held_lateral_mm", "moving_lateral_mm", "sag_mm", "settle_s",
)  # fmt: skip
FIGURES = (*_OF_LOOP, "unholdable", "similarity_pct", *robot_calibration.FIGURES)
"""Keys of a robot's figures."""

SEEDS = (1, 2, 3)


def run(
    files: Sequence[str],
    figures: Sequence[str],
    progress: Callable[[str], None],
    every: int = 1,
    sweep: Sweep | None = None,
    *,
    again: bool = False,
) -> dict[str, dict[str, Any]]:
    """Return the figures of `FIGURES` of every robot by name, the worst over `SEEDS`; `seeds`: the shares of each seed.

    uncalibrated_pct: lateral residual of the sag at the article's five poses and 20 random orientations of the base, with the
    model as described; calibrated_pct: with the calibrated one; moving_pct: with that one too, during the turns between them at
    30 deg/s. figures: only these, none: all; every > 1: one seed and so many times fewer orientations. A robot that fails has
    `errors`, and the others go on. again: measure also the parts that an earlier run finished. Raises ConfigError for a figure
    that does not exist.
    """
    for name in figures:
        if name not in FIGURES:
            raise ConfigError(f"--figures has '{name}'; allowed with --loop: {', '.join(FIGURES)}")
    wanted = list(figures) or list(FIGURES)
    seeds = SEEDS[:1] if every > 1 else SEEDS
    parts = [dataclasses.replace(part, again=again) for file in files for part in _parts(file, wanted, seeds, every)]
    finished = 0 if again else sum(path is not None and path.is_file() for path in map(path_of, parts))
    note = f"; {finished} were measured before" if finished else ""
    progress(f"loop of {len(files)} robots (0 of {len(parts)} parts{note})")
    own = sweep is None
    sweep = sweep or Sweep()
    try:
        results = sweep.map(
            compute, parts, lambda done, total: progress(f"{parts[done - 1].name} ({done} of {total} parts{note})")
        )
    finally:
        if own:
            sweep.close()
    found = {}
    for file in files:
        of_file = [(part, result) for part, result in zip(parts, results) if part.file == file]
        figures_of = _figures(of_file)
        found[_name(file)] = {key: figures_of.get(key) for key in wanted} | {
            key: figures_of[key] for key in ("seeds", "errors") if key in figures_of
        }
    return found


def _parts(file: str, wanted: Sequence[str], seeds: Sequence[int], every: int) -> list[Part]:
    """Return the parts from which the wanted figures of a robot follow."""
    kinds = {
        "loop": (_OF_LOOP, seeds),
        "calibration": (robot_calibration.FIGURES, seeds),
        "similarity": (("similarity_pct",), seeds[:1]),
        "holdability": (("unholdable",), seeds[:1]),
    }
    return [
        Part(kind, str(file), seed, every)
        for kind, (keys, of_kind) in kinds.items()
        if any(key in wanted for key in keys)
        for seed in of_kind
    ]


def _figures(results: Sequence[tuple[Part, dict[str, Any]]]) -> dict[str, Any]:
    """Return the figures of one robot from the results of its parts, the worst seed of each."""
    errors = {part.name: result["error"] for part, result in results if "error" in result}
    good = [(part, result) for part, result in results if "error" not in result]
    failed = {part.kind for part, result in results if "error" in result}
    found: dict[str, Any] = {"errors": errors} if errors else {}

    def of(kind: str) -> list[dict[str, Any]]:
        """Results of a kind of which no part failed."""
        return [] if kind in failed else [result for part, result in good if part.kind == kind]

    loops = of("loop")
    if loops:
        settled = [run["settled"] for run in loops]
        found |= {
            "uncalibrated_pct": _pct(loops, "held"),
            "uncalibrated_moving_pct": _pct(loops, "moving"),
            "held_lateral_mm": round(1e3 * max(run["held_m"] for run in loops), 3),
            "moving_lateral_mm": round(1e3 * max(run["moving_m"] for run in loops), 3),
            "sag_mm": round(1e3 * min(run["sag"] for run in loops), 2),
            "settle_s": None if None in settled else round(max(settled), 2),
            "seeds": {
                str(part.seed): {f"{key}_pct": round(100.0 * result[key], 2) for key in ("held", "moving")}
                for part, result in good
                if part.kind == "loop"
            },
        }
    calibrations = of("calibration")
    if calibrations:
        found |= robot_calibration.worst([Calibrated(**run) for run in calibrations])
    for run in of("similarity"):
        found["similarity_pct"] = None if run["difference"] is None else round(100.0 * run["difference"], 2)
    for run in of("holdability"):
        found["unholdable"] = run["reason"]
    return found


def _pct(runs: Sequence[dict[str, Any]], key: str) -> float:
    return round(max(100.0 * run[key] for run in runs), 2)


def _name(file: str) -> str:
    """Return the robot's name; the file's, where it cannot be read."""
    try:
        return load_robot_file(file).robot.name
    except ConfigError:
        return Path(file).stem
