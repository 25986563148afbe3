"""Figures of one robot's calibration: planned, measured on its virtual robot, fitted, and held with the calibrated model."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from gravcomp.calibration.estimates import edge_unit
from gravcomp.calibration.fit import StaticFit
from gravcomp.closed_loop.setup import Setup
from gravcomp.sweep import Sweep
from gravcomp.trials.calibration_run import calibrate_on_virtual_robot
from gravcomp.trials.context import Context
from gravcomp.trials.turning_base import residuals

FIGURES = ("calibrated_pct", "moving_pct", "modulus_error_pct", "compliance_error_pct", "calibrate_s")


@dataclass(frozen=True)
class Calibrated:
    """One seed: errors in percent; seconds of robot time.

    held, moving: residuals of the sag, at rest and while the base turns; compliance None: the data do not determine any.
    """

    held: float
    moving: float
    modulus: float
    compliance: float | None
    seconds: float


def measure(setup: Setup, orientations: int) -> Calibrated:
    """Calibrate the setup's virtual robot, and hold it. Raises ConfigError, NoEquilibrium, MeasurementError, RuntimeError."""
    with Sweep(1) as sweep:
        found = calibrate_on_virtual_robot(Context(setup, sweep))
    run = residuals(found.setup, orientations)
    time = found.measured.time
    return Calibrated(
        held=100.0 * run.held / run.sag,
        moving=100.0 * run.moving / run.sag,
        modulus=modulus_error(setup, found.fit),
        compliance=compliance_error(setup, found.fit),
        seconds=float(time[-1] - time[0]),
    )


def modulus_error(setup: Setup, fit: StaticFit) -> float:
    """Return the largest error of a segment's modulus in percent."""
    true = np.array([material.youngs_modulus for material in setup.true_robot.robot.materials])
    return float(100.0 * np.abs(fit.parameters.youngs_modulus / true - 1.0).max())


def compliance_error(setup: Setup, fit: StaticFit) -> float | None:
    """Return the largest error of a cable's compliance in percent, of those that the data determine; None: there are none.

    One whose interval is wider than the limit of the figure cannot be told that well, and says so.
    """
    lines, nominal = setup.true_robot.cables, setup.nominal
    inside = np.array([nominal.line_length(cable) - (cable.free_length or 0.0) for cable in nominal.cables])
    true = (lines.free_length + inside) / lines.axial_stiffness
    _, factor = edge_unit("compliance")
    errors = [
        100.0 * abs(e.value / (factor * true[e.index]) - 1.0)
        for e in fit.estimates
        if e.kind == "compliance" and e.seen and e.interval <= _TOLD * e.value
    ]
    return max(errors, default=None)


_TOLD = 0.1  # half interval over the value, up to which a compliance counts as determined


def worst(runs: list[Calibrated]) -> dict[str, Any]:
    """Return the figures of `FIGURES`, the worst of the runs; compliance_error_pct None: no interval is narrow enough to tell."""
    compliance = [run.compliance for run in runs if run.compliance is not None]
    return {
        "calibrated_pct": round(max(run.held for run in runs), 2),
        "moving_pct": round(max(run.moving for run in runs), 2),
        "modulus_error_pct": round(max(run.modulus for run in runs), 2),
        "compliance_error_pct": round(max(compliance), 1) if compliance else None,
        "calibrate_s": round(max(run.seconds for run in runs), 1),
    }
