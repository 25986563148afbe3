"""`gravcomp model info ROBOT`: mass, lengths, natural frequencies, whether its cables can hold it, reach, error of its mesh."""

import argparse
import dataclasses
from typing import TYPE_CHECKING, Any

from gravcomp.commands import output
from gravcomp.commands.model import hold
from gravcomp.commands.model.reach import reach
from gravcomp.commands.model.reach import text as reach_text

if TYPE_CHECKING:
    from gravcomp.description import Robot
    from gravcomp.simulation import Shape

_GRAVITY = 9.81


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the subcommand's arguments."""
    parser.add_argument(
        "robot", nargs="?", default="article", metavar="ROBOT", help="robot file or shipped robot (default: article)"
    )
    parser.add_argument(
        "--choose-mesh", action="store_true",
        help="find elements with a tip error of at most 0.1 %% of the length (seconds to minutes)",
    )  # fmt: skip
    hold.add_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Run the subcommand. Returns 0. Raises ConfigError, MeshError, ValueError."""
    import numpy as np

    from gravcomp.description import load_robot_file
    from gravcomp.full_model.mesh_choice import chosen_elements
    from gravcomp.full_model.modes import natural_frequencies
    from gravcomp.holdability.text import lines
    from gravcomp.mesh.quality import mesh_quality
    from gravcomp.simulation import Simulator

    if args.picture and args.no_hold:
        raise ValueError("--picture draws whether the robot can be held, which --no-hold leaves out; give one of them")
    file = load_robot_file(args.robot)
    simulator = Simulator(file.robot, reduced=False)
    robot, model = simulator.robot, simulator.model
    quality = mesh_quality(model.mesh)
    figures = {
        "robot": robot.name,
        "file": file.source,
        "length_mm": 1e3 * robot.length,
        "mass_g": 1e3 * model.mass,
        "payload_g": 1e3 * robot.payload.mass,
        "cables": {name: {"length_mm": 1e3 * length} for name, length in zip(robot.cable_names, model.tendons.rest_length)},
    }
    answer = hold.answer(args, model)
    if answer is not None and args.picture:
        hold.draw(answer, robot.name, args.picture)
    sag = simulator.solve(np.array([-_GRAVITY, 0.0, 0.0]))
    figures |= {
        "natural_frequency_hz": natural_frequencies(model).tolist(),
        "horizontal_tip_mm": (1e3 * sag.tip_position).tolist() if sag.is_equilibrium else None,
        "horizontal_message": sag.message,
        "hold": None if answer is None else hold.figures(answer, model),
        "reach": reach(simulator),
        "mesh": dataclasses.asdict(quality) | {"unknowns": model.pattern.n} | _mesh_error(robot, sag),
    }
    if args.choose_mesh and robot.body is None:
        figures["chosen_elements"] = dataclasses.asdict(chosen_elements(file.robot))
    output.result(figures, _text(figures, [] if answer is None else lines(robot, answer)))
    return 0


def _mesh_error(robot: "Robot", sag: "Shape") -> dict[str, Any]:
    """Return how far the horizontal robot's tip moves when the mesh is refined; for a body from a file return advice only."""
    import numpy as np

    from gravcomp.simulation import Simulator

    if robot.body is not None:
        return {"refinement": "use a finer mesh file (or lower element_size_mm) and compare horizontal_tip_mm"}
    elements = robot.elements
    assert elements is not None  # the model's robot has its mesh chosen
    finer = dataclasses.replace(elements, around=2 * elements.around, along=2 * elements.along)
    change = Simulator(dataclasses.replace(robot, elements=finer), reduced=False).solve(np.array([-_GRAVITY, 0.0, 0.0]))
    if not (change.is_equilibrium and sag.is_equilibrium):
        return {"tip_change_when_refined_mm": None, "refinement": "not known: no equilibrium of the released robot was found"}
    error = float(np.linalg.norm(change.tip_position - sag.tip_position))
    good = error < 2e-3 * robot.length
    return {
        "tip_change_when_refined_mm": 1e3 * error,
        "refinement": "fine enough"
        if good
        else "raise elements.along or elements.around: the change is above 0.2 % of the length",
    }


def _text(figures: dict[str, Any], hold_lines: list[str]) -> str:
    mesh, tip = figures["mesh"], figures["horizontal_tip_mm"]
    lines = [
        f"{figures['robot']} ({figures['file']})",
        f"  length {figures['length_mm']:.1f} mm, mass {figures['mass_g']:.2f} g (payload {figures['payload_g']:.2f} g)",
        "  cables " + ", ".join(f"{name} {cable['length_mm']:.1f} mm" for name, cable in figures["cables"].items()),
        "  natural frequencies " + ", ".join(f"{f:.2f}" for f in figures["natural_frequency_hz"]) + " Hz",
        "  tip when horizontal, cables released: "
        + (figures["horizontal_message"] if tip is None else ", ".join(f"{x:.2f}" for x in tip) + " mm"),
    ]
    lines += [f"  {line}" for line in hold_lines]
    if figures["reach"]:
        lines += reach_text(figures["reach"])
    lines.append(
        f"  mesh: {mesh['elements']} {mesh['kind']}, {mesh['nodes']} nodes, {mesh['unknowns']} unknowns;"
        f" worst Jacobian ratio {mesh['jacobian_ratio']:.2f}, worst aspect ratio {mesh['aspect_ratio']:.1f}"
    )
    if mesh.get("tip_change_when_refined_mm") is not None:
        lines.append(
            f"  with twice the elements along and around the horizontal tip moves by"
            f" {mesh['tip_change_when_refined_mm']:.3f} mm: {mesh['refinement']}"
        )
    else:
        lines.append(f"  refinement: {mesh['refinement']}")
    lines += [f"  advice: {sentence}" for sentence in mesh["advice"]]
    if "chosen_elements" in figures:
        numbers = ", ".join(f"{name}: {value}" for name, value in figures["chosen_elements"].items())
        lines.append(f"  elements that reach 0.1 % of the length: {{{numbers}}}")
    return "\n".join(lines)
