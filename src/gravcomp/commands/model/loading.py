"""Arguments that `solve` and `view` share, a robot and its load, and the shape that they give."""

import argparse
from typing import TYPE_CHECKING

from gravcomp.commands.model.wrenches import add_wrench_arguments, wrenches_of

if TYPE_CHECKING:
    import numpy as np

    from gravcomp.full_model.wrench import Wrench
    from gravcomp.inverse import Command, Target
    from gravcomp.scene.scene import Scene
    from gravcomp.simulation import Shape, Simulator


def add_load_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the robot, gravity and the input to the cables."""
    parser.add_argument(
        "robot", nargs="?", default="article", metavar="ROBOT", help="robot file or shipped robot (default: article)"
    )
    parser.add_argument(
        "--gravity", nargs=3, type=float, default=[-9.81, 0.0, 0.0], metavar=("X", "Y", "Z"),
        help="m/s^2 in soft_base, z along the robot (default: -9.81 0 0, the robot horizontal)",
    )  # fmt: skip
    cables = parser.add_mutually_exclusive_group()
    cables.add_argument("--tension", nargs="+", type=float, metavar="N", help="tension of every cable, N")
    cables.add_argument(
        "--displacement",
        nargs="+",
        type=float,
        metavar="MM",
        help="displacement of every cable, mm, positive: pulled in; nan: released",
    )
    cables.add_argument(
        "--target", nargs=3, type=float, metavar=("X", "Y", "Z"), help="tip position to reach with the cables, mm"
    )
    parser.add_argument("--direction", nargs=3, type=float, metavar=("X", "Y", "Z"), help="tip direction to reach, with --target")
    add_wrench_arguments(parser)
    parser.add_argument("--full", action="store_true", help="use the full model even when a reduced model exists")


def loaded_shape(args: argparse.Namespace) -> "tuple[Simulator, Shape, Command | None]":
    """Return the simulator, the shape and, with a target, the controller's last command (else None).

    Raises ConfigError, ValueError, MeshError when the robot or an argument cannot be used.
    """
    import numpy as np

    from gravcomp.commands.preparation import choose_mesh, compile_parts
    from gravcomp.description import load_robot_file
    from gravcomp.launcher import compilation
    from gravcomp.simulation import Simulator
    from gravcomp.standard_gravity import LARGEST_GRAVITY

    if args.direction is not None and args.target is None:
        raise ValueError("--direction needs --target, which is not given")
    if not np.isfinite(args.gravity).all():
        raise ValueError(f"--gravity is {args.gravity}; finite numbers are needed")
    if (size := float(np.linalg.norm(args.gravity))) > LARGEST_GRAVITY:
        raise ValueError(f"--gravity is {size:g} m/s^2 long; allowed: up to {LARGEST_GRAVITY:g} (9.81 on the earth)")
    wrenches = wrenches_of(args)
    file = load_robot_file(args.robot)
    names = file.robot.cable_names
    for option, values in (("--tension", args.tension), ("--displacement", args.displacement)):
        if values is not None and len(values) != len(names):
            needed = f"one for each cable is needed: {', '.join(names)}" if names else "the robot has no cables"
            raise ValueError(f"{option} has {len(values)} numbers; {needed}")
    wanted = _wanted(args, file.robot.length)
    if file.scene or file.zones:
        parts = [*compilation.LOOP, *compilation.SURROUNDED]
        if wanted is None:
            parts = ["model", "contact"] if args.full else ["model", "contact", "reduced_contact"]
        compile_parts((*parts, *(compilation.ITSELF if file.scene.self_contact else ())))
    choose_mesh(file.robot)
    simulator = Simulator(file.robot, reduced=not args.full, scene=file.scene)
    gravity = np.array(args.gravity)
    if wanted is not None:
        shape, command = _reached(simulator, gravity, wanted, wrenches, file.zones)
        return simulator, shape, command
    displacement = None if args.displacement is None else 1e-3 * np.array(args.displacement)
    shape = simulator.solve(gravity, displacement, args.tension, wrench=wrenches)
    if not args.full and not shape.status:
        # Where a reduced model exists it gives the shape, starting from the full model's solution.
        shape = simulator.step(gravity, displacement, args.tension, wrench=wrenches)
    return simulator, shape, None


def _wanted(args: argparse.Namespace, length: float) -> "Target | None":
    """Return the target of the arguments for a robot of `length` (m), or None. Raises TargetError."""
    if args.target is None:
        return None
    import numpy as np

    from gravcomp.inverse import Target

    weight = 0.01 if args.direction is not None else 0.0
    towards = None if args.direction is None else np.array(args.direction)
    wanted = Target(1e-3 * np.array(args.target), tip_direction=towards, tip_direction_weight=weight)
    wanted.check_reach(length)
    return wanted


def _reached(
    simulator: "Simulator",
    gravity: "np.ndarray",
    wanted: "Target",
    wrenches: "tuple[Wrench, ...]",
    zones: "Scene",
) -> "tuple[Shape, Command]":
    """Run the closed loop of model and inverse problem until the tip is at rest."""
    import numpy as np

    from gravcomp.inverse import InverseController

    controller = InverseController(simulator.robot, scene=simulator.scene, zones=zones)
    shape = simulator.solve(gravity, wrench=wrenches)
    before = shape.tip_position
    for _ in range(2000):
        command = controller.step(
            shape.response,
            wanted,
            backbone_station=shape.backbone_station,
            tension=shape.cable_tension,
            interval=0.02,
            followed=shape.is_equilibrium,
            contact=shape.contacts.by_obstacle(),
            gravity=gravity,
        )
        shape = simulator.step(gravity, command.displacement, wrench=wrenches)
        if shape.is_equilibrium and np.linalg.norm(shape.tip_position - before) < 1e-8:
            break
        before = shape.tip_position
    return shape, command
