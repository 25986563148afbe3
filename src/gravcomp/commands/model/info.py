"""`gravcomp model info ROBOT`: mass, lengths, natural frequencies and reach of a robot's model, and the error of its mesh."""

import argparse
import dataclasses
from typing import TYPE_CHECKING, Any

from gravcomp.commands import output

if TYPE_CHECKING:
    from gravcomp.description import Robot
    from gravcomp.simulation import RobotModel, Shape, Simulator

_GRAVITY = 9.81


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the subcommand's arguments."""
    parser.add_argument(
        "robot", nargs="?", default="article", metavar="ROBOT", help="robot file or shipped robot (default: article)"
    )


def run(args: argparse.Namespace) -> int:
    """Run the subcommand. Returns 0. Raises ConfigError, MeshError."""
    import numpy as np

    from gravcomp.description import load_robot_file
    from gravcomp.full_model.modes import natural_frequencies
    from gravcomp.mesh.quality import mesh_quality
    from gravcomp.simulation import Simulator

    file = load_robot_file(args.robot)
    simulator = Simulator(file.robot, reduced=False)
    robot, model = simulator.robot, simulator.model
    quality = mesh_quality(model.mesh)
    sag = simulator.solve(np.array([-_GRAVITY, 0.0, 0.0]))
    figures = {
        "robot": robot.name,
        "file": file.source,
        "length_mm": 1e3 * robot.length,
        "mass_g": 1e3 * model.mass,
        "payload_g": 1e3 * robot.payload.mass,
        "cables": _cables(model),
        "natural_frequency_hz": natural_frequencies(model).tolist(),
        "horizontal_tip_mm": (1e3 * sag.tip_position).tolist(),
        "reach": _reach(simulator),
        "mesh": dataclasses.asdict(quality) | {"unknowns": model.pattern.n} | _mesh_error(file.robot, robot, sag),
    }
    if robot.body is not None:
        figures["mesh_file"] = {"file": robot.body.file, "notes": list(robot.body.placed().notes)}
    output.result(figures, _text(figures))
    return 0


def _cables(model: "RobotModel") -> dict[str, dict[str, float | None]]:
    """Return length, line and stretch at the largest tension of each cable; stiffness None: it does not stretch."""
    robot, tendons = model.robot, model.tendons
    return {
        cable.name: {
            "length_mm": 1e3 * float(length),
            "free_length_mm": 1e3 * (cable.free_length or 0.0),
            "axial_stiffness_n": cable.stiffness if cable.stretches else None,
            "largest_stretch_mm": 1e3 * float(compliance) * robot.limits.tension_max,
        }
        for cable, length, compliance in zip(robot.cables, tendons.rest_length, tendons.axial_compliance)
    }


def _lines(cables: dict[str, dict[str, float | None]]) -> list[str]:
    """Return the sentences about the cables' lines, one for each kind of line."""
    kinds: dict[tuple, list[str]] = {}
    for name, cable in cables.items():
        values = tuple(None if value is None else round(value, 3) for value in list(cable.values())[1:])
        kinds.setdefault(values, []).append(name)
    sentences = []
    for (free, stiffness, stretch), names in kinds.items():
        if stiffness is None:
            sentences.append(f"  lines of {', '.join(names)}: not described, without stretch")
        else:
            sentences.append(
                f"  lines of {', '.join(names)}: E A {stiffness:.0f} N, {free:g} mm from capstan to robot,"
                f" stretch {stretch:.2f} mm at the largest tension"
            )
    return sentences


def _reach(simulator: "Simulator") -> list[dict[str, Any]]:
    """Return how far each cable alone moves the weightless robot: with growing tension, up to the limits or a half turn."""
    import numpy as np

    from gravcomp.full_model.cable_input import CableInput

    robot, reach = simulator.robot, []
    for index, name in enumerate(robot.cable_names):
        simulator.reset()
        best: dict[str, Any] = {"cable": name, "tension_n": 0.0, "displacement_mm": 0.0, "lateral_mm": 0.0, "tilt_deg": 0.0}
        for tension in np.linspace(0.0, robot.limits.tension_max, 41)[1:]:
            tensions = np.zeros(len(robot.cables))
            tensions[index] = tension
            # The reach ends where tracking ends; the load step is not divided further.
            if not simulator.solver.track(np.zeros(3), CableInput(tension=tensions), iterations=10).converged:
                break
            shape = simulator.step(np.zeros(3), tension=tensions)
            if shape.message and "law_range_left_at_n" not in best:
                best["law_range_left_at_n"], best["law_range"] = float(tension), shape.message
            tilt = float(np.degrees(np.arccos(np.clip(shape.tip_direction[2], -1.0, 1.0))))
            beyond = shape.cable_displacement[index] > robot.limits.displacement_max
            if beyond or tilt < best["tilt_deg"]:
                break
            lateral = 1e3 * float(np.hypot(*shape.tip_position[:2]))
            best |= {
                "tension_n": float(tension),
                "displacement_mm": 1e3 * float(shape.cable_displacement[index]),
                "lateral_mm": max(lateral, best["lateral_mm"]),
                "tilt_deg": tilt,
            }
        reach.append(best)
    return reach


def _mesh_error(described: "Robot", robot: "Robot", sag: "Shape") -> dict[str, Any]:
    """Return the estimated error of a chosen mesh, or how far the horizontal tip moves when the described one is refined.

    For a body from a file return advice only.
    """
    import numpy as np

    from gravcomp.full_model.mesh_choice import ACCURACY, chosen_mesh
    from gravcomp.simulation import Simulator

    if robot.body is not None:
        return {"refinement": "use a finer mesh file (or lower element_size_mm) and compare horizontal_tip_mm"}
    elements = robot.elements
    assert elements is not None  # the model's robot has its mesh chosen
    if described.elements is None:
        error = chosen_mesh(described).error
        return {
            "chosen_elements": dataclasses.asdict(elements),
            "estimated_error_pct": 100 * error,
            "refinement": "fine enough" if error <= ACCURACY else f"the error is above {100 * ACCURACY:g} % of the length",
        }
    finer = dataclasses.replace(elements, around=2 * elements.around, along=2 * elements.along)
    change = Simulator(dataclasses.replace(robot, elements=finer), reduced=False).solve(np.array([-_GRAVITY, 0.0, 0.0]))
    error = float(np.linalg.norm(change.tip_position - sag.tip_position))
    good = error < 2e-3 * robot.length
    return {
        "tip_change_when_refined_mm": 1e3 * error,
        "refinement": "fine enough"
        if good
        else "raise elements.along or elements.around: the change is above 0.2 % of the length",
    }


def _text(figures: dict[str, Any]) -> str:
    mesh = figures["mesh"]
    lines = [
        f"{figures['robot']} ({figures['file']})",
        f"  length {figures['length_mm']:.1f} mm, mass {figures['mass_g']:.2f} g (payload {figures['payload_g']:.2f} g)",
        "  cables " + ", ".join(f"{name} {cable['length_mm']:.1f} mm" for name, cable in figures["cables"].items()),
        *_lines(figures["cables"]),
        "  natural frequencies " + ", ".join(f"{f:.2f}" for f in figures["natural_frequency_hz"]) + " Hz",
        "  tip when horizontal, cables released: " + ", ".join(f"{x:.2f}" for x in figures["horizontal_tip_mm"]) + " mm",
        "  reach of each cable alone, without gravity:",
    ]
    lines += [
        f"    {r['cable']}: {r['lateral_mm']:.1f} mm lateral, tip tilted by {r['tilt_deg']:.0f} deg,"
        f" at {r['tension_n']:.2f} N and {r['displacement_mm']:.1f} mm"
        for r in figures["reach"]
    ]
    lines += [f"    warning: at {r['law_range_left_at_n']:.2f} N {r['law_range']}" for r in figures["reach"] if "law_range" in r]
    lines.append(
        f"  mesh: {mesh['elements']} {mesh['kind']}, {mesh['nodes']} nodes, {mesh['unknowns']} unknowns;"
        f" worst Jacobian ratio {mesh['jacobian_ratio']:.2f}, worst aspect ratio {mesh['aspect_ratio']:.1f}"
    )
    if "chosen_elements" in mesh:
        numbers = ", ".join(f"{name}: {str(value).lower()}" for name, value in mesh["chosen_elements"].items())
        lines.append(
            f"  elements chosen: {{{numbers}}}; with twice as many each way the tip, horizontal or bent to its limit, moves by"
            f" about {mesh['estimated_error_pct']:.2g} % of the length: {mesh['refinement']}"
        )
    elif "tip_change_when_refined_mm" in mesh:
        lines.append(
            f"  with twice the elements along and around the horizontal tip moves by"
            f" {mesh['tip_change_when_refined_mm']:.3f} mm: {mesh['refinement']}"
        )
    else:
        lines.append(f"  refinement: {mesh['refinement']}")
    lines += [f"  advice: {sentence}" for sentence in mesh["advice"]]
    if "mesh_file" in figures:
        lines.append(f"  body from {figures['mesh_file']['file']}:")
        lines += [f"    {note}" for note in figures["mesh_file"]["notes"]]
    return "\n".join(lines)
