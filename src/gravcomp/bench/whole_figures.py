"""The model against computations and measurements of others: figures that belong to no single robot file."""

import dataclasses
import logging
from collections.abc import Callable, Sequence
from typing import Any

from gravcomp.bench.engine import calculix_error
from gravcomp.config import ConfigError
from gravcomp.experiments import measured
from gravcomp.trials.coverage import coverage_of_robots

Progress = Callable[[str], None]

FIGURES = {
    "ccx_error_pct": "calculix",
    "disks_error_pct": "disks",
    "rod_error_pct": "rod_wrench",
    "beam_rest_mm": "beam",
    "beam_motion_mm": "beam",
    "tentacle_mm": "tentacle",
    "tentacle_held_mm": "tentacle",
    "tdcr_mm": "tdcr",
    "coverage_pct": "coverage",
    "coverage_width": "coverage",
    "coverage": "coverage",
}
"""Each figure and what it comes from: CalculiX' stored table, a part of `reproduce measured`, or `trials.coverage`.

coverage_pct: share of the 95 % intervals of a calibration that contain the truth, of the worst kind of parameter and robot;
coverage_width: half width of the intervals over the deviation of the errors, widest kind and robot;
coverage: share, width and number of intervals of each robot and kind.
"""

_COVERED = ("tpu_3_long", "silicone_long")  # in addition to the article's, of ../shared/robots
_SEEDS = 50


def run(progress: Progress, wanted: Sequence[str], every: int = 1) -> dict[str, Any]:
    """Return the figures that are wanted; None, with a warning, where the data are missing. every > 1: fewer, coarser cases."""
    result: dict[str, Any] = dict.fromkeys(wanted)
    folder = measured.default_folder()
    for source in dict.fromkeys(FIGURES[name] for name in wanted):
        try:
            if source == "calculix":
                data = {"ccx_error_pct": calculix_error(progress, every)["calculix_error_pct"]}
            elif source == "coverage":
                data = _coverage(progress, every)
            else:
                data = measured.run(folder, progress, (source,), brief=every > 1).data
        except ConfigError as error:
            logging.getLogger(__name__).warning("%s: %s", source, error)
            continue
        for name in wanted:
            if FIGURES[name] == source:
                result[name] = data.get(name)
                if result[name] is None:
                    logging.getLogger(__name__).warning("%s: %s is not computed from these data", source, name)
    return result


def _coverage(progress: Progress, every: int) -> dict[str, Any]:
    """Return the coverage of the article's robot and two strangers, where their files are. every > 1: fewer seeds."""
    folder = measured.default_folder().parent / "robots"
    files = ["article", *(str(folder / f"{name}.yaml") for name in _COVERED if (folder / f"{name}.yaml").is_file())]
    if len(files) < 1 + len(_COVERED):
        logging.getLogger(__name__).warning("%s: not all of %s are there; fewer robots are covered", folder, ", ".join(_COVERED))
    found = coverage_of_robots(files[:1] if every > 1 else files, range(1, 1 + max(3, _SEEDS // every)), progress)
    covered = [one for kinds in found.values() for one in kinds.values()]
    if not covered:
        return {}
    return {
        "coverage_pct": round(100.0 * min(one.share for one in covered), 1),
        "coverage_width": round(max(one.width for one in covered), 2),
        "coverage": {robot: {kind: dataclasses.asdict(one) for kind, one in kinds.items()} for robot, kinds in found.items()},
    }
