"""The part of `gravcomp model info` that answers whether a robot can be held: arguments, progress, picture."""

import argparse
from typing import TYPE_CHECKING, Any

from gravcomp.commands import output

if TYPE_CHECKING:
    from gravcomp.full_model.robot_model import RobotModel
    from gravcomp.holdability import DirectionAnswer, Holdability
    from gravcomp.inverse.target import Target


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("--no-hold", action="store_true", help="leave out whether the robot can be held")
    target = parser.add_mutually_exclusive_group()
    target.add_argument(
        "--target", nargs=3, type=float, metavar=("X", "Y", "Z"), help="tip position to hold, mm (default: the tip at rest)"
    )
    target.add_argument("--bend", nargs=2, type=float, metavar=("ANGLE", "PLANE"), help="bend to hold and its plane, deg")
    parser.add_argument(
        "--directions", type=int, default=12, metavar="N",
        help="directions of gravity around the robot, with as many rings as fit (default: 12, that is 45 to 47 in all)",
    )  # fmt: skip
    parser.add_argument("--picture", metavar="FILE", help="draw the sphere of directions: .png, .svg or .pdf")


def check(args: argparse.Namespace, length: float) -> None:
    """Raise ValueError for arguments out of range, TargetError for a target out of reach of a robot of `length` (m)."""
    if not 4 <= args.directions <= 180:
        raise ValueError(f"--directions is {args.directions}; allowed: 4 to 180")
    _target(args, length)


def answer(args: argparse.Namespace, model: "RobotModel") -> "Holdability | None":
    """Return the answer, with progress and a first answer on stderr; None with --no-hold and for a robot without cables."""
    if args.no_hold or not model.robot.cables:
        return None
    from rich.progress import BarColumn, TextColumn, TimeElapsedColumn

    from gravcomp.holdability import HoldOptions, holdability

    columns = TextColumn("{task.description:<40}"), BarColumn(), TimeElapsedColumn()
    with output.display(*columns) as progress:
        task = progress.add_task("can it be held: linear estimate", total=None)

        def advance(count: int, total: int, latest: "DirectionAnswer | None") -> None:
            held = "" if latest is None else f", last one {'held' if latest.held else 'not held'}"
            progress.update(task, total=total, completed=count, description=f"can it be held: {count} of {total}{held}")

        return holdability(
            model, _target(args, model.length), HoldOptions(equator=args.directions), progress=advance, first=output.note
        )


def draw(answer: "Holdability", name: str, file: str) -> None:
    """Draw the sphere of directions into a file."""
    from gravcomp.environment.packages import provide_extra

    provide_extra("reports")
    from gravcomp.commands.model.sphere_picture import save

    save(answer, name, file)


def figures(answer: "Holdability", model: "RobotModel") -> dict[str, Any]:
    """Return the answer for --json."""
    from gravcomp.holdability.as_json import as_json

    return as_json(model.robot, answer)


def _target(args: argparse.Namespace, length: float) -> "Target | None":
    import numpy as np

    from gravcomp.inverse.target import Target, bend_target

    if args.bend is not None:
        return bend_target(length, *np.radians(args.bend))
    if args.target is None:
        return None
    target = Target(1e-3 * np.array(args.target))
    target.check_reach(length)
    return target
