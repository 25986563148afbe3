"""`gravcomp calibrate DATA`: fit the robot's model to measured tip positions; `--plan`: which ones to measure.

Prints the fitted parameters with their intervals and warnings, writes a file with them that stands on the robot file, and a
report page with the model's error before and after.
"""

import argparse
import time
from pathlib import Path
from typing import TYPE_CHECKING

from gravcomp.commands import output
from gravcomp.commands.folders import checked_target, made_folder
from gravcomp.commands.parsers import in_range, namespace
from gravcomp.commands.tip_calibration import KEPT, plan_options
from gravcomp.commands.virtual_seed import add_seed_argument

if TYPE_CHECKING:
    from rich.console import RenderableType

    from gravcomp.calibration.plan import Plan
    from gravcomp.description import RobotFile
    from gravcomp.report.result import Result

INTERRUPTED = 130
"""Exit code after Ctrl-C."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.description = (
        "Fit a robot to measured tip positions: Young's modulus of each segment, density, zero, stretch and place of each cable,"
        " capstan radius, friction, mount and offset of the IMU, damping and creep, as far as the data tell them. DATA is a CSV"
        " file with the columns trial, time_s, gravity_x, gravity_y, gravity_z (m/s^2),"
        " CABLE_mm for every cable (empty: released), tip_x_mm, tip_y_mm, tip_z_mm, and where it is known specific_force (m/s^2,"
        " its length by the IMU); or a bag with gravity, cable/state, measured/tip (geometry_msgs/PoseStamped in soft_base) and,"
        " where it was recorded, imu/data; or the table that --plan writes, filled in. With --mapping, DATA"
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
    parser.add_argument(
        "--namespace", type=namespace, default="", metavar="NS", help="with --live: the robot in this namespace (default: /)"
    )
    parser.add_argument(
        "--time",
        type=in_range(float, 10.0, 3600.0, "s"),
        metavar="S",
        help="robot time of the plan in s (default: 180); with --plan, --live and virtual",
    )
    add_seed_argument(parser, "; with virtual")
    parser.add_argument(
        "--mass-g",
        type=in_range(float, 1e-3, 1e6, "g"),
        metavar="G",
        help="weighed mass of body and payload in g: the data then tell density",
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
    for group, words in KEPT.items():
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
    from gravcomp.calibration.apply import overlay_path
    from gravcomp.config import ConfigError
    from gravcomp.description import load_robot_file

    if (args.data is not None) + args.plan + args.live != 1:
        raise ConfigError("give one of DATA (a CSV file, a bag or 'virtual'), --plan and --live")
    if args.material and (args.mapping or args.data in (None, "virtual")):
        raise ConfigError("--material needs a CSV file as DATA, and excludes --mapping, --plan and --live")
    file = load_robot_file(args.robot)
    if args.plan:
        return _plan(args, file)
    made_folder("--out", Path(args.out).expanduser())
    named = Path(args.write).expanduser() if args.write else overlay_path(file.source, file.robot.name)
    target = checked_target("--write", named)
    if args.live:
        found = _measured_live(args, file)
        if found is None:
            return INTERRUPTED
        args.data = str(found)
    return _calibrate(args, file, target)


def _calibrate(args: argparse.Namespace, file: "RobotFile", target: Path) -> int:
    """Fit to the data, and write the robot file `target` and the page. Returns 0. Raises ConfigError."""
    from gravcomp.commands.material_calibration import fit_material
    from gravcomp.commands.pose_calibration import fit_pose_table
    from gravcomp.commands.tip_calibration import fit_tips
    from gravcomp.report.page import write_report

    started = time.perf_counter()
    fit = fit_material if args.material else fit_pose_table if args.mapping else fit_tips
    result = fit(args, file, target)
    result.seconds = time.perf_counter() - started
    page = write_report(result, Path(args.out).expanduser())
    output.result({**result.to_mapping(), "written": str(target)}, _readable(result, target, page))
    return 0


def _plan(args: argparse.Namespace, file: "RobotFile") -> int:
    """Print the plan, and write the table. Returns 0. Raises ConfigError."""
    from gravcomp.calibration.plan_table import instruction, pulls, write_plan_table

    target = checked_target("--write", Path(args.write or f"{file.robot.name}-plan.csv").expanduser())
    plan = _planned(args, file)
    write_plan_table(plan, file.robot, target)
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
    """Return the plan of the robot. Raises ConfigError, and MeshError for a body that cannot be meshed."""
    from gravcomp.calibration.approach import as_pulled
    from gravcomp.calibration.planning import make_plan
    from gravcomp.closed_loop.setup import Setup
    from gravcomp.full_model.modes import first_period

    setup = Setup.of(file)
    inverse = None if args.plan else setup.controller.inverse  # by hand, one cable at a time is enough
    period, transmission = first_period(setup.robot), setup.hardware.transmission
    with output.stages("planning") as show:
        plan = make_plan(
            as_pulled(setup.robot, setup.hardware), period, transmission, plan_options(args), progress=show, inverse=inverse
        )
    if plan.note:
        output.note(plan.note)
    return plan


def _measured_live(args: argparse.Namespace, file: "RobotFile") -> Path | None:
    """Return the file of the poses measured on the running graph, None: interrupted. Raises ConfigError."""
    from gravcomp.commands.live_calibration import measured_live, plan_of

    folder = Path()
    plan = None if plan_of(folder, file.robot.name).exists() else _planned(args, file)
    return measured_live(plan, folder, str(Path(file.source).resolve()), file.robot.name, args.tip_topic, args.namespace)


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
