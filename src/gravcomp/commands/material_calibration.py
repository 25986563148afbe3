"""`gravcomp calibrate TABLE --material`: the Prony series of the robot's material from a relaxation or creep test."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gravcomp.description import RobotFile
    from gravcomp.report.result import Result


def fit_material(args: argparse.Namespace, file: "RobotFile", target: Path) -> "Result":
    """Fit, write the robot file `target`, and return the result. Raises ConfigError."""
    from gravcomp.calibration.apply import write_calibrated
    from gravcomp.calibration.material_recording import read_material_recording
    from gravcomp.calibration.material_report import material_result
    from gravcomp.calibration.measured import MeasurementError
    from gravcomp.calibration.prony_fit import fit_series
    from gravcomp.config import ConfigError

    try:
        test = read_material_recording(args.data)
        fit = fit_series(test)
    except MeasurementError as error:
        raise ConfigError(str(error)) from error
    write_calibrated(file.source, target, file.robot, file.robot.with_material(prony=fit.prony, creep_ratio=0.0), None)
    return material_result(test, fit, str(target))
