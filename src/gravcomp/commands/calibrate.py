"""`gravcomp calibrate DATA`: fit the robot's model to measured tip positions; `--plan`: which ones to measure.

Prints the fitted parameters with their intervals and warnings, writes a file with them that stands on the robot file, and a
report page with the model's error before and after.
"""

import argparse
import contextlib
import time
from pathlib import Path
from typing import TYPE_CHECKING

from gravcomp.commands import output
from gravcomp.commands.virtual_seed import add_seed_argument, seed_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from rich.console import RenderableType

    from gravcomp.calibration.data import Data
    from gravcomp.calibration.plan import Plan, PlanOptions
    from gravcomp.calibration.standstill import Standstill
    from gravcomp.closed_loop.setup import Setup
    from gravcomp.description import RobotFile
    from gravcomp.report.result import Result
    from gravcomp.sweep import Sweep

INTERRUPTED = 130
"""Exit code after Ctrl-C."""

_KEPT = {
    "offsets": "the zeros of the cables", "compliance": "the cables' stretch", "winding": "the capstan radius",
    "places": "radii and angles of the cables", "weight": "density and payload", "mount": "the mount of the IMU",
    "slow-creep": "the creep", "friction": "the friction of the cables",
}  # fmt: skip
"""What is not fitted if its option is given."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.description = (
        "Fit a robot to measured tip positions: Young's modulus of each segment, density, zero, stretch and place of each cable,"
        " capstan radius, friction, mount of the IMU, damping and creep, as far as the data tell them. DATA is a CSV file with"
        " the columns trial, time_s, gravity_x, gravity_y, gravity_z (m/s^2),"
        " CABLE_mm for every cable (empty: released), tip_x_mm, tip_y_mm, tip_z_mm; or a bag with gravity, cable/state and"
        " measured/tip (geometry_msgs/PoseStamped in soft_base); or the table that --plan writes, filled in. With --mapping, DATA"
        " is a table of poses at rest with any"
        " columns, measured by markers anywhere on the robot, under tensions or displacements and hung weights."
        " With --material, DATA is a relaxation or creep test of the robot's material."
    )
    parser.add_argument(
        "data",
        metavar="DATA",
        nargs="?",
        help="CSV file or rosbag2 folder; 'virtual' plans, and measures the virtual robot of the robot file",
    )
    parser.add_argument("--robot", default="article", help="robot file or shipped robot to start from (default: article)")
    parser.add_argument(
        "--plan", action="store_true", help="print the poses that tell most, and write the table NAME-plan.csv to fill in"
    )
    parser.add_argument(
        "--live",
        action="store_true",
        help="lead through the plan on the running graph (./gravcomp up), and fit; interrupted, the same line goes on",
    )
    parser.add_argument("--namespace", default="", metavar="NS", help="with --live: the robot in this namespace (default: /)")
    parser.add_argument(
        "--time", type=float, metavar="S", help="robot time of the plan in s (default: 180); with --plan, --live and virtual"
    )
    add_seed_argument(parser, "; with virtual")
    parser.add_argument(
        "--mass-g", type=float, metavar="G", help="weighed mass of body and payload in g: the data then tell density"
    )
    parser.add_argument(
        "--write", metavar="YAML", help="file to write, which stands on the robot file (default: NAME-calibrated.yaml next to it)"
    )
    parser.add_argument(
        "--out", metavar="DIR", default="reports", help="folder for the report page and its JSON (default: reports)"
    )
    parser.add_argument(
        "--tip-topic", metavar="TOPIC", help="topic of the measured tip in a bag (default: measured/tip or truth/tip)"
    )
    parser.add_argument("--no-damping", action="store_true", help="keep the damping of the robot file")
    parser.add_argument(
        "--creep", action="store_true", help="also fit creep to motion; needs a fast one, e.g. a free fall, at 50 Hz or more"
    )
    for group, words in _KEPT.items():
        parser.add_argument(f"--no-{group}", action="store_true", help=f"keep {words} of the robot file")
    parser.add_argument(
        "--mapping",
        metavar="YAML",
        help="DATA is a table of poses at rest with any columns; this file says what they mean, and what is fitted",
    )
    parser.add_argument(
        "--material",
        action="store_true",
        help="DATA is a relaxation or creep test: time_s, and stress, force, strain or displacement; gives the material's prony",
    )
    parser.add_argument("--workers", type=int, metavar="N", help="number of processes (default: one per core)")


def run(args: argparse.Namespace) -> int:
    """Plan, or fit and write. Returns 0: the file is written, 130: interrupted. Raises ConfigError."""
    from gravcomp.config import ConfigError
    from gravcomp.description import load_robot_file

    if args.time is not None and not 10.0 <= args.time <= 3600.0:
        raise ConfigError(f"--time is {args.time:g} s; allowed: 10 to 3600 s")
    if args.mass_g is not None and not 1e-3 <= args.mass_g <= 1e6:
        raise ConfigError(f"--mass-g is {args.mass_g:g} g; allowed: 0.001 to 1000000 g")
    if (args.data is not None) + args.plan + args.live != 1:
        raise ConfigError("give one of DATA (a CSV file, a bag or 'virtual'), --plan and --live")
    if args.material and (args.mapping or args.data in (None, "virtual")):
        raise ConfigError("--material needs a CSV file as DATA, and excludes --mapping, --plan and --live")
    file = load_robot_file(args.robot)
    if args.plan:
        return _plan(args, file)
    if args.live:
        found = _measured_live(args, file)
        if found is None:
            return INTERRUPTED
        args.data = str(found)
    if args.material:
        return _material(args, file)
    return _poses(args, file) if args.mapping else _fit(args, file)


def _plan(args: argparse.Namespace, file: "RobotFile") -> int:
    """Print the plan, and write the table. Returns 0. Raises ConfigError."""
    from gravcomp.calibration.plan_table import instruction, pulls, write_plan_table
    from gravcomp.config import ConfigError

    target = Path(args.write or f"{file.robot.name}-plan.csv").expanduser()
    plan = _planned(args, file)
    try:
        write_plan_table(plan, file.robot, target)
    except OSError as error:
        raise ConfigError(f"{target}: cannot be written: {error.strerror}") from error
    lines = [f"{len(plan.poses)} poses, {plan.duration:.0f} s of robot time, {plan.rest:.1f} s at rest in each:"]
    steps = [{"do": instruction(pose), "cables": pulls(file.robot, pose)} for pose in plan.poses]
    lines += [f"{number:3d}  {step['do']}: {step['cables']}" for number, step in enumerate(steps, start=1)]
    lines += [
        "In each pose, wait until nothing moves; measure the tip in soft_base (z along the straight robot, x to the cables'"
        f" angle 0) and write it into {target}.",
        f"Weigh the robot, and fit: ./gravcomp calibrate {target} --robot {args.robot} --mass-g MASS",
    ]
    figures = {"poses": steps, "duration_s": round(plan.duration, 1), "rest_s": round(plan.rest, 2), "written": str(target)}
    output.result(figures, "\n".join(lines))
    return 0


def _planned(args: argparse.Namespace, file: "RobotFile") -> "Plan":
    """Return the plan of the robot. Raises ConfigError."""
    from gravcomp.calibration.plan import make_plan
    from gravcomp.closed_loop.setup import Setup
    from gravcomp.config import ConfigError
    from gravcomp.full_model.modes import first_period
    from gravcomp.mesh import MeshError

    setup = Setup.of(file)
    inverse = None if args.plan else setup.controller.inverse  # by hand, one cable at a time is enough
    period, transmission = first_period(setup.robot), setup.hardware.transmission
    with _progress("planning") as show:
        try:
            return make_plan(setup.robot, period, transmission, _options(args), progress=show, inverse=inverse)
        except MeshError as error:
            raise ConfigError(str(error)) from error


def _measured_live(args: argparse.Namespace, file: "RobotFile") -> Path | None:
    """Return the file of the poses measured on the running graph, None: interrupted. Raises ConfigError."""
    from gravcomp.commands.live_calibration import measured_live, plan_of

    folder = Path()
    plan = None if plan_of(folder, file.robot.name).exists() else _planned(args, file)
    return measured_live(plan, folder, str(Path(file.source).resolve()), file.robot.name, args.tip_topic, args.namespace)


def _fit(args: argparse.Namespace, file: "RobotFile") -> int:
    """Fit to resting tips and to motion, and write. Returns 0. Raises ConfigError."""
    from gravcomp.calibration.apply import calibrated_hardware, calibrated_robot, overlay_path, with_behaviour, write_calibrated
    from gravcomp.calibration.fit import fit_statics
    from gravcomp.calibration.measured import MeasurementError
    from gravcomp.calibration.motion import fit_motion
    from gravcomp.calibration.moving import moving
    from gravcomp.calibration.report import calibration_result, origin_of
    from gravcomp.calibration.standstill import Standstill
    from gravcomp.closed_loop.setup import Setup
    from gravcomp.config import ConfigError
    from gravcomp.full_model.modes import first_period
    from gravcomp.mesh import MeshError
    from gravcomp.mesh.coarse import with_coarse_elements
    from gravcomp.report.page import write_report
    from gravcomp.sweep import Sweep

    setup = Setup.of(file, seed_of(args))
    if args.data == "virtual":
        output.note(setup.true_robot.summary())
    target = Path(args.write).expanduser() if args.write else overlay_path(file.source, file.robot.name)
    started = time.perf_counter()
    with Sweep(args.workers) as sweep, _progress("reading") as show:
        try:
            still = Standstill.of(setup.robot, first_period(setup.robot))
            data = _data(args, setup, still, sweep, show)
            statics = fit_statics(
                setup.robot,
                data.windows,
                groups=_groups(args),
                mass=data.mass,
                creep_times=data.creep_times,
                progress=show,
            )
            robot = calibrated_robot(setup.robot, statics.parameters, creep_times=statics.creep_times)
            hardware = calibrated_hardware(setup.hardware, statics.parameters)
            courses = [] if args.no_damping or data.measured is None else moving(data.measured, statics.parameters, still)
            motion, lost = None, ""
            if courses:
                try:
                    motion = fit_motion(
                        with_coarse_elements(robot),
                        courses,
                        modulus=False,
                        creep=args.creep,
                        mapper=sweep.map,
                        progress=lambda s: show(f"damping: {s}"),
                    )
                except RuntimeError as error:  # what was found at rest still counts
                    lost = str(error)
                if motion is not None and motion.rms_after > motion.rms_before:
                    before, after = 1e3 * motion.rms_before, 1e3 * motion.rms_after
                    lost, motion = f"the fit to the motion is worse: {before:.2f} mm before, {after:.2f} mm after", None
                if motion is not None and motion.damping_seen:
                    robot = with_behaviour(robot, motion)
        except (MeasurementError, MeshError, RuntimeError) as error:
            raise ConfigError(str(error)) from error
    write_calibrated(
        file.source,
        target,
        setup.robot,
        robot,
        hardware,
        setup.seed if args.data == "virtual" else None,
        origin_of(file.source, data.source, statics),
    )
    result = calibration_result(data.source, str(target), statics, motion, courses, setup.robot.materials[0].damping_time)
    if data.duration is not None:
        result.data["robot_time_s"] = round(data.duration, 1)
    if lost:
        result.notes.insert(0, f"damping time: {lost}; the value of the robot file is kept")
    elif not courses and not args.no_damping:
        result.notes.insert(0, "damping time: no trial contains fast motion; the value of the robot file is kept")
    result.seconds = time.perf_counter() - started
    page = write_report(result, Path(args.out).expanduser())
    output.result({**result.to_mapping(), "written": str(target)}, _readable(result, target, page))
    return 0


def _poses(args: argparse.Namespace, file: "RobotFile") -> int:
    """Fit to a table of poses, and write. Returns 0. Raises ConfigError."""
    from gravcomp.calibration.apply import overlay_path, robot_of_poses, write_calibrated
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
    target = Path(args.write).expanduser() if args.write else overlay_path(file.source, file.robot.name)
    started = time.perf_counter()
    with _progress("reading") as show:
        try:
            poses = read_poses(args.data, mapping, file.robot.cable_names)
            fit = fit_poses(
                file.robot,
                poses,
                unknowns_of(mapping.fit, file.robot),
                progress=show,
            )
        except (MeasurementError, MeshError) as error:
            raise ConfigError(str(error)) from error
    write_calibrated(file.source, target, file.robot, robot_of_poses(file.robot, fit.parameters), None)
    result = pose_result(poses, fit, str(target))
    result.seconds = time.perf_counter() - started
    page = write_report(result, Path(args.out).expanduser())
    output.result({**result.to_mapping(), "written": str(target)}, _readable(result, target, page))
    return 0


def _material(args: argparse.Namespace, file: "RobotFile") -> int:
    """Fit to a test of the material, and write. Returns 0. Raises ConfigError."""
    from gravcomp.commands.material_calibration import fit_material

    result, target, page = fit_material(args, file)
    output.result({**result.to_mapping(), "written": str(target)}, _readable(result, target, page))
    return 0


def _data(args: argparse.Namespace, setup: "Setup", still: "Standstill", sweep: "Sweep", show: "Callable[[str], None]") -> "Data":
    """Return what was measured: from the given file, or of the virtual robot. Raises MeasurementError, RuntimeError."""
    from gravcomp.calibration.data import Data, read_data
    from gravcomp.calibration.plan import creep_times

    mass = None if args.mass_g is None else 1e-3 * args.mass_g
    if args.data != "virtual":
        return read_data(args.data, setup.robot, still, mass, args.tip_topic)
    from gravcomp.trials.calibration_run import measure, plan_of, weighed
    from gravcomp.trials.context import Context

    context = Context(setup, sweep, show)
    plan = plan_of(context, _options(args))
    measured = measure(context, plan)
    return Data.of(measured, still, weighed(setup) if mass is None else mass, creep_times(plan.rest), plan.duration)


def _groups(args: argparse.Namespace) -> set[str]:
    """Return what is fitted in addition to the moduli."""
    return {name.replace("slow-creep", "creep") for name in _KEPT if not getattr(args, f"no_{name.replace('-', '_')}")}


def _options(args: argparse.Namespace) -> "PlanOptions":
    """Return the options of the plan."""
    from gravcomp.calibration.plan import PlanOptions

    return PlanOptions() if args.time is None else PlanOptions(budget=args.time)


@contextlib.contextmanager
def _progress(first: str) -> "Iterator[Callable[[str], None]]":
    """Context with a line that shows the present stage; yields the function that changes it."""
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with Progress(*columns, console=output.console(), transient=True) as progress:
        task = progress.add_task(first)
        yield lambda stage: progress.update(task, description=stage)


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
