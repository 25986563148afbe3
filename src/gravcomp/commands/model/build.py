"""`gravcomp model build ROBOT`: build the reduced model of a robot, which the simulator then uses."""

import argparse
from typing import Any

from gravcomp.commands import output


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument(
        "robot", nargs="?", default="article", metavar="ROBOT", help="robot file or shipped robot (default: article)"
    )
    parser.add_argument("--force", action="store_true", help="build it again when it exists")


def run(args: argparse.Namespace) -> int:
    """Run the subcommand. Returns 0: built, or built already. Raises ConfigError, MeshError when the robot cannot be reduced."""
    from gravcomp.reduction import path_of

    model, reduction, seconds = prepare(args.robot, force=args.force)
    figures = {
        "robot": model.robot.name,
        "unknowns": reduction.basis.shape[0],
        "modes": reduction.basis.shape[1],
        "strains": reduction.elasticity.linear.shape[0],
        "samples": reduction.samples,
        "tip_error_median_mm": 1e3 * reduction.error_median,
        "tip_error_worst_mm": 1e3 * reduction.error_worst,
        "youngs_modulus_mpa": [1e-6 * reduction.modulus_low, 1e-6 * reduction.modulus_high],
        "seconds": seconds,
        "file": str(path_of(model)),
    }
    output.result(figures, _text(figures))
    return 0


def prepare(robot: str, *, force: bool = False) -> tuple:
    """Return (model, its reduction, seconds of the build); built with a progress bar unless it exists.

    Raises ConfigError, MeshError.
    """
    from gravcomp.launcher.model_builder import note_stored
    from gravcomp.reduction import path_of

    model, reduction, seconds = _built(robot, force)
    note_stored(robot, path_of(model))
    return model, reduction, seconds


def _built(robot: str, force: bool) -> tuple:
    from rich.progress import BarColumn, TextColumn, TimeElapsedColumn

    from gravcomp.commands.preparation import choose_mesh
    from gravcomp.description import load_robot_file
    from gravcomp.full_model.robot_model import RobotModel
    from gravcomp.reduction import load
    from gravcomp.training.build import alone, build

    described = load_robot_file(robot).robot
    choose_mesh(described)
    model = RobotModel(described)
    reduction = None if force else load(model)
    if reduction is not None:
        return model, reduction, 0.0
    columns = TextColumn("{task.description:<12}"), BarColumn(), TimeElapsedColumn()
    with output.display(*columns) as progress:
        task = progress.add_task("training", total=1.0)
        with alone(model, lambda: progress.update(task, description="waiting for another build")):
            reduction = None if force else load(model)
            if reduction is not None:
                return model, reduction, 0.0
            reduction, seconds = build(
                model, progress=lambda stage, share: progress.update(task, description=stage, completed=share)
            )
    return model, reduction, seconds


def prepare_model(robot: str) -> None:
    """Build the reduced model of a robot when it is missing; a robot that cannot be reduced uses its full model."""
    from gravcomp.config import ConfigError

    try:
        prepare(robot)
    except ConfigError as error:
        output.note(f"No reduced model: {error}")


def _text(figures: dict[str, Any]) -> str:
    low, high = figures["youngs_modulus_mpa"]
    took = f"built in {figures['seconds']:.0f} s" if figures["seconds"] else "was built before (--force builds it again)"
    return (
        f"{figures['robot']}: the reduced model {took}: {figures['modes']} modes and {figures['strains']} strains in place of"
        f" {figures['unknowns']} unknowns\n"
        f"trained with {figures['samples']} shapes; tip error for other shapes: median {figures['tip_error_median_mm']:.4f} mm,"
        f" worst {figures['tip_error_worst_mm']:.3f} mm; valid for Young's moduli from {low:.3g} to {high:.3g} MPa\n"
        f"stored in {figures['file']}"
    )
