"""The model against computations and measurements of others: figures that belong to no single robot file."""

import logging
from collections.abc import Callable, Sequence
from typing import Any

from gravcomp.bench.engine import calculix_error
from gravcomp.config import ConfigError
from gravcomp.experiments import measured

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
}
"""Each figure and what it comes from: CalculiX' stored table, or a part of `reproduce measured`."""


def run(progress: Progress, wanted: Sequence[str], every: int = 1) -> dict[str, Any]:
    """Return the figures that are wanted; None, with a warning, where the data are missing. every > 1: fewer, coarser cases."""
    result: dict[str, Any] = dict.fromkeys(wanted)
    folder = measured.default_folder()
    for source in dict.fromkeys(FIGURES[name] for name in wanted):
        try:
            if source == "calculix":
                data = {"ccx_error_pct": calculix_error(progress, every)["calculix_error_pct"]}
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
