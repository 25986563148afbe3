"""`gravcomp model view ROBOT`: draw the robot at rest and deformed, or with its sections as it is described."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from gravcomp.commands import output
from gravcomp.commands.folders import checked_target
from gravcomp.commands.model.loading import add_load_arguments, loaded_shape

if TYPE_CHECKING:
    import numpy as np

    from gravcomp.mesh import Mesh


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the subcommand's arguments."""
    add_load_arguments(parser)
    parser.add_argument(
        "--rest", action="store_true", help="draw the body at rest with its sections, lumens, disks and cables; nothing is solved"
    )
    parser.add_argument(
        "--out", default="robot.png", metavar="FILE", help="image to write: .png, .svg or .pdf (default: robot.png)"
    )


def run(args: argparse.Namespace) -> int:
    """Run the subcommand. Returns 0: the image is written. Raises ConfigError, ValueError, MeshError."""
    from gravcomp.environment.packages import provide_extra

    checked_target("--out", Path(args.out))
    provide_extra("reports")
    if args.rest:
        return _draw_described(args)
    import matplotlib
    import numpy as np

    matplotlib.use("Agg")
    from matplotlib.figure import Figure
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    simulator, shape, _ = loaded_shape(args)
    mesh = simulator.model.mesh
    faces = _surface(mesh)
    figure = Figure(figsize=(8, 7))
    axes = figure.add_subplot(projection="3d")
    places = (mesh.nodes, "0.85", "0.75", 0.15), (mesh.nodes + simulator.displacements, "tab:orange", "0.3", 0.5)
    for nodes, colour, edge, alpha in places:
        axes.add_collection3d(Poly3DCollection(1e3 * nodes[faces], facecolor=colour, edgecolor=edge, linewidth=0.2, alpha=alpha))
    axes.plot(*(1e3 * shape.backbone_position.T), "k.-", label="backbone")
    everything = 1e3 * np.vstack([mesh.nodes, mesh.nodes + simulator.displacements])
    low, high = everything.min(axis=0), everything.max(axis=0)
    half = (high - low).max() / 2
    for middle, limits in zip((low + high) / 2, (axes.set_xlim, axes.set_ylim, axes.set_zlim)):
        limits(middle - half, middle + half)
    axes.set(xlabel="x / mm", ylabel="y / mm", zlabel="z / mm")
    tip = ", ".join(f"{value:.1f}" for value in 1e3 * shape.tip_position)
    axes.set_title(f"{simulator.robot.name}: tip at {tip} mm")
    figure.savefig(args.out, dpi=150)
    figures = {"file": args.out, "tip_position_mm": 1e3 * shape.tip_position, "residual_n": shape.residual}
    output.result(figures, f"{args.out}: tip at {tip} mm, residual {shape.residual:.1e} N")
    return 0


def _draw_described(args: argparse.Namespace) -> int:
    """Draw the robot at rest."""
    from gravcomp.description import load_robot_file
    from gravcomp.report.body_picture import draw_body

    robot = load_robot_file(args.robot).robot
    draw_body(robot, args.out)
    output.result(
        {"file": args.out, "length_mm": 1e3 * robot.length}, f"{args.out}: {robot.name}, {robot.length * 1e3:g} mm long"
    )
    return 0


def _surface(mesh: "Mesh") -> "np.ndarray":
    """Return the corner nodes (f, 3 or 4) of the faces that belong to a single element."""
    import numpy as np

    from gravcomp.mesh.elements import faces

    corners = faces(mesh.kind)
    found = mesh.elements[:, corners].reshape(-1, corners.shape[1])
    _, index, count = np.unique(np.sort(found, axis=1), axis=0, return_index=True, return_counts=True)
    return found[index[count == 1]]
