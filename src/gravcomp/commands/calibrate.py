"""`gravcomp calibrate DATA`: fit the robot's model to measured tip positions.

Prints the fitted parameters with their intervals and warnings, writes a robot file with them and a report page with the
model's error before and after.
"""

import argparse
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gravcomp.commands import output
from gravcomp.commands.virtual_seed import add_seed_argument, seed_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from rich.console import RenderableType

    from gravcomp.calibration.measured import Measured
    from gravcomp.closed_loop.setup import Setup
    from gravcomp.description import RobotFile
    from gravcomp.report.result import Result
    from gravcomp.sweep import Sweep

_MOVING = 3e-3  # m within half a second: a trial that moves this far shows the damping
_LONGEST = 4.0  # s of such a trial are used to fit the damping


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.description = (
        "Fit Young's modulus, damping, cable offsets, cable elasticity and the capstan radius to measured tip positions; with"
        " --creep also creep. DATA is a CSV file with the columns trial, time_s, gravity_x, gravity_y, gravity_z (m/s^2),"
        " CABLE_mm for every cable (empty: released), tip_x_mm, tip_y_mm, tip_z_mm; or a bag with gravity, cable/state and"
        " measured/tip (geometry_msgs/PoseStamped in soft_base). With --mapping, DATA is a table of poses at rest with any"
        " columns, measured by markers anywhere on the robot, under tensions or displacements and hung weights."
    )
    parser.add_argument(
        "data", metavar="DATA", help="CSV file or rosbag2 folder; 'virtual' measures the virtual robot of the robot file"
    )
    parser.add_argument("--robot", default="article", help="robot file or shipped robot to start from (default: article)")
    add_seed_argument(parser, "; with virtual")
    parser.add_argument("--write", metavar="YAML", help="calibrated robot file to write (default: NAME-calibrated.yaml)")
    parser.add_argument(
        "--out", metavar="DIR", default="reports", help="folder for the report page and its JSON (default: reports)"
    )
    parser.add_argument(
        "--tip-topic", metavar="TOPIC", help="topic of the measured tip in a bag (default: measured/tip or truth/tip)"
    )
    parser.add_argument("--no-damping", action="store_true", help="keep the damping of the robot file")
    parser.add_argument(
        "--creep", action="store_true", help="also fit creep; needs a fast motion, e.g. a free fall, at 50 Hz or more"
    )
    parser.add_argument("--no-offsets", action="store_true", help="keep the cable offsets of the robot file")
    parser.add_argument("--no-compliance", action="store_true", help="keep the cable elasticity of the robot file")
    parser.add_argument("--no-winding", action="store_true", help="keep the capstan radius of the robot file")
    parser.add_argument(
        "--mapping",
        metavar="YAML",
        help="DATA is a table of poses at rest with any columns; this file says what they mean, and what is fitted",
    )
    parser.add_argument("--workers", type=int, metavar="N", help="number of processes (default: one per core)")


def run(args: argparse.Namespace) -> int:
    """Fit and write. Returns 0: the robot file is written. Raises ConfigError."""
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    from gravcomp.calibration.apply import calibrated_hardware, calibrated_robot, write_calibrated
    from gravcomp.calibration.fit import fit_statics
    from gravcomp.calibration.measured import MeasurementError, still_windows
    from gravcomp.calibration.motion import fit_motion
    from gravcomp.calibration.report import calibration_result
    from gravcomp.closed_loop.setup import Setup
    from gravcomp.commands.model.build import prepare_model
    from gravcomp.config import ConfigError
    from gravcomp.description import load_robot_file
    from gravcomp.report.page import write_report
    from gravcomp.sweep import Sweep

    file = load_robot_file(args.robot)
    if args.mapping:
        return _poses(args, file)
    setup = Setup.of(file, seed_of(args))
    if args.data == "virtual":
        output.note(setup.true_robot.summary())
    prepare_model(args.robot)
    target = Path(args.write or f"{file.robot.name}-calibrated.yaml").expanduser()
    started = time.perf_counter()
    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with Sweep(args.workers) as sweep, Progress(*columns, console=output.console(), transient=True) as progress:
        task = progress.add_task("reading")

        def show(stage: str) -> None:
            progress.update(task, description=stage)

        try:
            measured = _measured(args, setup, sweep, show)
            statics = fit_statics(
                setup.robot,
                still_windows(measured),
                offsets=not args.no_offsets,
                compliance=not args.no_compliance,
                winding=not args.no_winding,
                progress=show,
            )
            robot = calibrated_robot(setup.robot, statics.parameters)
            hardware = calibrated_hardware(setup.hardware, statics.parameters)
            courses = [] if args.no_damping else _moving(measured, statics.parameters)
            motion = None
            if courses:
                motion = fit_motion(
                    robot, courses, modulus=False, creep=args.creep, mapper=sweep.map, progress=lambda s: show(f"damping: {s}")
                )
                if motion.damping_seen:
                    robot = motion.robot
        except (MeasurementError, RuntimeError) as error:
            raise ConfigError(str(error)) from error
    write_calibrated(file.source, target, robot, hardware, setup.seed if args.data == "virtual" else None)
    result = calibration_result(measured.source, str(target), statics, motion, courses, setup.robot.materials[0].damping_time)
    if not courses and not args.no_damping:
        result.notes.insert(0, "damping time: no trial contains fast motion; the value of the robot file is kept")
    result.seconds = time.perf_counter() - started
    page = write_report(result, Path(args.out).expanduser())
    output.result({**result.to_mapping(), "written": str(target)}, _readable(result, target, page))
    return 0


def _poses(args: argparse.Namespace, file: "RobotFile") -> int:
    """Fit to a table of poses, and write. Returns 0. Raises ConfigError."""
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    from gravcomp.calibration.apply import robot_of_poses, write_calibrated
    from gravcomp.calibration.mapping import load_mapping
    from gravcomp.calibration.measured import MeasurementError
    from gravcomp.calibration.pose_fit import fit_poses
    from gravcomp.calibration.pose_report import pose_result
    from gravcomp.calibration.pose_table import read_poses
    from gravcomp.calibration.pose_unknowns import unknowns_of
    from gravcomp.config import ConfigError
    from gravcomp.mesh import MeshError
    from gravcomp.report.page import write_report

    mapping = load_mapping(args.mapping)
    target = Path(args.write or f"{file.robot.name}-calibrated.yaml").expanduser()
    started = time.perf_counter()
    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with Progress(*columns, console=output.console(), transient=True) as progress:
        task = progress.add_task("reading")
        try:
            poses = read_poses(args.data, mapping, file.robot.cable_names)
            fit = fit_poses(
                file.robot,
                poses,
                unknowns_of(mapping.fit, file.robot),
                progress=lambda stage: progress.update(task, description=stage),
            )
        except (MeasurementError, MeshError) as error:
            raise ConfigError(str(error)) from error
    write_calibrated(file.source, target, robot_of_poses(file.robot, fit.parameters), None)
    result = pose_result(poses, fit, str(target))
    result.seconds = time.perf_counter() - started
    page = write_report(result, Path(args.out).expanduser())
    output.result({**result.to_mapping(), "written": str(target)}, _readable(result, target, page))
    return 0


def _measured(args: argparse.Namespace, setup: "Setup", sweep: "Sweep", show: "Callable[[str], None]") -> "Measured":
    """Return the measurements: from the given file, or of the virtual robot. Raises MeasurementError."""
    from gravcomp.calibration.files import read_measured

    if args.data != "virtual":
        return read_measured(args.data, setup.robot.cable_names, args.tip_topic)
    from gravcomp.trials.calibration_run import measure
    from gravcomp.trials.context import Context

    return measure(Context(setup, sweep, show))


def _moving(measured: "Measured", parameters: Any) -> "list[Measured]":
    """Return the first seconds of the trials with fast motion, with the fitted offsets and winding ratio applied."""
    import dataclasses

    import numpy as np

    found = []
    for trial in measured.trials():
        trial = trial.rows(trial.time <= trial.time[0] + _LONGEST)
        period = max(np.median(np.diff(trial.time)), 1e-6) if len(trial.time) > 2 else 1.0
        reach = max(1, round(0.5 / period))
        moved = np.linalg.norm(trial.tip_position[reach:] - trial.tip_position[:-reach], axis=1).max(initial=0.0)
        if moved > _MOVING and period < 0.1:
            found.append(dataclasses.replace(trial, displacement=parameters.winding * trial.displacement + parameters.offset))
    return found


def _readable(result: "Result", target: Path, page: Path) -> "RenderableType":
    """Return the table of parameters, the notes and the written files for the terminal."""
    from rich.console import Group
    from rich.markup import escape
    from rich.table import Table as RichTable

    from gravcomp.report.result import Table

    parameters = result.parts[0]
    assert isinstance(parameters, Table)
    table = RichTable(box=None, pad_edge=False)
    for column in parameters.header:
        table.add_column(column)
    for row in parameters.rows:
        table.add_row(*(str({True: "yes", False: "no"}.get(cell, cell)) for cell in row))
    notes = [f"[yellow]-[/yellow] {escape(note)}" for note in result.notes]
    return Group(table, *notes, f"written: [bold]{escape(str(target))}[/bold]", f"[dim]{escape(str(page))}[/dim]")
