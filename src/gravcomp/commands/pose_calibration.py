"""`gravcomp calibrate TABLE --mapping YAML`: the robot's parameters from a table of poses at rest."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from gravcomp.commands import output

if TYPE_CHECKING:
    from gravcomp.description import RobotFile
    from gravcomp.report.result import Result


def fit_pose_table(args: argparse.Namespace, file: "RobotFile", target: Path) -> "Result":
    """Fit, write the robot file `target`, and return the result. Raises ConfigError."""
    from gravcomp.calibration.apply import robot_of_poses, write_calibrated
    from gravcomp.calibration.mapping import load_mapping
    from gravcomp.calibration.measured import MeasurementError
    from gravcomp.calibration.pose_fit import fit_poses
    from gravcomp.calibration.pose_report import pose_result
    from gravcomp.calibration.pose_table import read_poses
    from gravcomp.calibration.pose_unknowns import unknowns_of
    from gravcomp.config import ConfigError
    from gravcomp.mesh import MeshError

    mapping = load_mapping(args.mapping)
    with output.stages("reading") as show:
        try:
            poses = read_poses(args.data, mapping, file.robot.cable_names)
            fit = fit_poses(file.robot, poses, unknowns_of(mapping.fit, file.robot), progress=show)
        except MeasurementError as error:
            raise ConfigError(str(error)) from error
        except MeshError as error:  # weights that the mapping hangs outside the body, or a body that cannot be meshed
            raise ConfigError(f"{args.mapping}, with the robot of {file.source}: {error}") from error
    write_calibrated(file.source, target, file.robot, robot_of_poses(file.robot, fit.parameters), None)
    return pose_result(poses, fit, str(target))
