"""`gravcomp calibrate DATA`: fit the robot's model to measured tips, with intervals, warnings and a before/after page; writes the robot's YAML."""

import argparse
import json
import time
from pathlib import Path

from gravcomp.config import ConfigError

_MOVING = 3e-3  # m within half a second: a trial with motion, that tells the damping
_LONGEST = 4.0  # s of a trial that the damping is fitted to


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.description = (
        "Fit Young's modulus, damping, cable offsets, cable elasticity and the capstans' radius, and on demand creep, to measured tips. DATA is a CSV file with the columns trial, time_s,"
        " gravity_x, gravity_y, gravity_z (m/s^2), CABLE_mm for every cable (empty: released), tip_x_mm, tip_y_mm, tip_z_mm; or a bag with gravity,"
        " cable/state and measured/tip (geometry_msgs/PoseStamped in soft_base)."
    )
    parser.add_argument(
        "data", metavar="DATA", help="CSV file or rosbag2 folder; 'virtual': measure the virtual robot of the robot's file"
    )
    parser.add_argument("--robot", default="article", help="robot file or shipped robot to start from (default: article)")
    parser.add_argument("--write", metavar="YAML", help="where the calibrated robot goes (default: NAME-calibrated.yaml here)")
    parser.add_argument("--out", metavar="DIR", default="reports", help="where the page and its JSON go (default: reports)")
    parser.add_argument("--tip-topic", help="the tip's topic, for a bag (default: measured/tip or truth/tip)")
    parser.add_argument("--no-damping", action="store_true", help="leave the damping as it is")
    parser.add_argument(
        "--creep", action="store_true", help="fit creep besides; it takes a free fall or the like, at 50 Hz or more"
    )
    parser.add_argument("--no-offsets", action="store_true", help="leave the cables' offsets as they are")
    parser.add_argument("--no-compliance", action="store_true", help="leave the cables' elasticity as it is")
    parser.add_argument("--no-winding", action="store_true", help="leave the capstans' radius as it is")
    parser.add_argument("--workers", type=int, help="processes (default: one a core)")
    parser.add_argument("--json", action="store_true", help="print the result as JSON, last line of the output")


def run(args: argparse.Namespace) -> int:
    """Run the command; 0: written. Raises ConfigError."""
    from rich.console import Console
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    from gravcomp.calibration.apply import calibrated_hardware, calibrated_robot, write_calibrated
    from gravcomp.calibration.fit import fit_statics
    from gravcomp.calibration.measured import MeasurementError, still_windows
    from gravcomp.calibration.motion import fit_motion
    from gravcomp.calibration.report import calibration_result
    from gravcomp.closed_loop.setup import Setup
    from gravcomp.commands.model.build import prepare_model
    from gravcomp.description import load_robot_file
    from gravcomp.report.page import write_report
    from gravcomp.sweep import Sweep

    file = load_robot_file(args.robot)
    setup = Setup.of(file)
    prepare_model(args.robot)
    target = Path(args.write or f"{file.robot.name}-calibrated.yaml").expanduser()
    console = Console(stderr=True)
    started = time.perf_counter()
    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with Sweep(args.workers) as sweep, Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task("reading")

        def tell(sentence: str) -> None:
            progress.update(task, description=sentence)

        try:
            measured = _measured(args, setup, sweep, tell)
            statics = fit_statics(
                setup.robot,
                still_windows(measured),
                offsets=not args.no_offsets,
                compliance=not args.no_compliance,
                winding=not args.no_winding,
                progress=tell,
            )
            robot, hardware = (
                calibrated_robot(setup.robot, statics.parameters),
                calibrated_hardware(setup.hardware, statics.parameters),
            )
            courses = [] if args.no_damping else _moving(measured, statics.parameters)
            motion = None
            if courses:
                motion = fit_motion(
                    robot, courses, modulus=False, creep=args.creep, mapper=sweep.map, progress=lambda s: tell(f"damping: {s}")
                )
                if motion.damping_seen:
                    robot = motion.robot
        except (MeasurementError, RuntimeError) as error:
            raise ConfigError(str(error)) from error
    write_calibrated(file.source, target, robot, hardware)
    result = calibration_result(
        measured.source, str(target), statics, motion, courses, setup.robot.segments[0].material.damping_time
    )
    if not courses and not args.no_damping:
        result.notes.insert(0, "damping time: no trial holds fast motion, so it stays as it is")
    result.seconds = time.perf_counter() - started
    page = write_report(result, Path(args.out).expanduser())
    _tell(console, result)
    console.print(f"written: [bold]{target}[/bold]\n[dim]{page}[/dim]")
    if args.json:
        print(json.dumps({**result.to_mapping(), "written": str(target)}))
    return 0


def _measured(args: argparse.Namespace, setup, sweep, tell):
    from gravcomp.calibration.files import read_measured

    if args.data != "virtual":
        return read_measured(args.data, setup.robot.cable_names, args.tip_topic)
    from gravcomp.trials.calibration_run import measure
    from gravcomp.trials.context import Context

    return measure(Context(setup, sweep, tell))


def _moving(measured, parameters) -> list:
    """The beginnings of the trials with fast motion, offsets and winding ratio put in."""
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


def _tell(console, result) -> None:
    from rich.table import Table as RichTable

    parameters = result.parts[0]
    table = RichTable(box=None, pad_edge=False)
    for column in parameters.header:
        table.add_column(column)
    for row in parameters.rows:
        table.add_row(*(str({True: "yes", False: "no"}.get(cell, cell)) for cell in row))
    console.print(table)
    for note in result.notes:
        console.print(f"[yellow]-[/yellow] {note}")
