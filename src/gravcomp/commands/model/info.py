"""`gravcomp model info ROBOT`: mass, lengths, natural frequencies, whether its cables can hold it, reach, error of its mesh."""

import argparse
import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gravcomp.commands import output
from gravcomp.commands.folders import checked_target
from gravcomp.commands.model import hold
from gravcomp.commands.model.reach import reach
from gravcomp.commands.model.reach import text as reach_text

if TYPE_CHECKING:
    from gravcomp.description import Robot, RobotFile
    from gravcomp.full_model.recovered_strain import MeshEstimate
    from gravcomp.simulation import RobotModel, Shape

_GRAVITY = 9.81
_NO_SAG = 1e-6  # of the length: a weightless robot's, by rounding


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the subcommand's arguments."""
    parser.add_argument(
        "robot", nargs="?", default="article", metavar="ROBOT", help="robot file or shipped robot (default: article)"
    )
    hold.add_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Run the subcommand. Returns 0. Raises ConfigError, MeshError, ValueError."""
    import numpy as np

    from gravcomp.commands.preparation import choose_mesh
    from gravcomp.description import load_robot_file
    from gravcomp.full_model.modes import natural_frequencies
    from gravcomp.holdability.text import lines
    from gravcomp.mesh.quality import mesh_quality
    from gravcomp.simulation import Simulator

    if args.picture and args.no_hold:
        raise ValueError("--picture draws whether the robot can be held, which --no-hold leaves out; give one of them")
    if args.picture:
        checked_target("--picture", Path(args.picture))
    file = load_robot_file(args.robot)
    hold.check(args, file.robot.length)
    choose_mesh(file.robot)
    simulator = Simulator(file.robot, reduced=False)
    robot, model = simulator.robot, simulator.model
    quality = mesh_quality(model.mesh)
    figures = {
        "robot": robot.name,
        "file": file.source,
        "length_mm": 1e3 * robot.length,
        "mass_g": 1e3 * model.mass,
        "payload_g": 1e3 * robot.payload.mass,
        "cables": _cables(model),
    }
    answer = hold.answer(args, model)
    if answer is not None and args.picture:
        hold.draw(answer, robot.name, args.picture)
    sag = simulator.solve(np.array([-_GRAVITY, 0.0, 0.0]))
    figures |= {
        "natural_frequency_hz": natural_frequencies(model).tolist(),
        "horizontal_tip_mm": (1e3 * sag.tip_position).tolist() if sag.is_equilibrium else None,
        "horizontal_message": sag.message,
        "play": _play(file, robot, sag),
        "motors": _motors(file),
        "hold": None if answer is None else hold.figures(answer, model),
        "reach": reach(simulator),
        "mesh": dataclasses.asdict(quality) | {"unknowns": model.pattern.n} | _mesh_error(file.robot, model, sag),
    }
    if robot.body is not None:
        figures["mesh_file"] = {"file": robot.body.file, "notes": list(robot.body.placed().notes)}
    output.result(figures, _text(figures, [] if answer is None else lines(robot, answer)))
    return 0


def _motors(file: "RobotFile") -> dict[str, Any] | None:
    """Return the tension that the motors reach, and what is wrong with it; None without cables, and for joints."""
    from gravcomp.holdability.motor_tension import weak_motors

    if not file.robot.cables or file.has_joints:
        return None
    return {"tension_n": file.hardware.weakest_tension, "advice": weak_motors(file.hardware, file.robot.limits)}


def _play(file: "RobotFile", robot: "Robot", sag: "Shape") -> dict[str, Any] | None:
    """Return what the backlash of the gears leaves open at the tip of the released, horizontal robot; None without cables."""
    import numpy as np
    from scipy.spatial.transform import Rotation

    from gravcomp.holdability.play import play_of
    from gravcomp.mesh.robot_axis import rest_tip

    if not robot.cables or not sag.is_equilibrium:
        return None
    position, direction = rest_tip(robot)
    away = sag.tip_position - position
    sagged = float(np.linalg.norm(away - direction * (direction @ away)))
    if sagged < _NO_SAG * robot.length:
        sagged = 0.0
    along = Rotation.from_quat(sag.tip_orientation).apply((0.0, 0.0, 1.0))
    play = play_of(file.hardware, sag.response, along, sagged)
    return {
        "backlash_deg": float(np.degrees(play.backlash)),
        "capstan_radius_mm": 1e3 * play.capstan,
        "cable_mm": 1e3 * play.cable,
        "tip_mm": 1e3 * play.tip,
        "of_sag_pct": 100.0 * play.share if sagged > 0.0 else None,
        "large": play.large,
        "sentence": play.text(),
    }


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
    from gravcomp.description.cable_line import ASSUMED_FREE_LENGTH, ASSUMED_STRETCH

    kinds: dict[tuple, list[str]] = {}
    for name, cable in cables.items():
        values = tuple(None if value is None else round(value, 3) for value in list(cable.values())[1:])
        kinds.setdefault(values, []).append(name)
    sentences = []
    for (free, stiffness, stretch), names in kinds.items():
        if stiffness is None:
            sentences.append(
                f"  lines of {', '.join(names)}: not described, without stretch; the loop assumes {100 * ASSUMED_STRETCH:g} %"
                f" at the largest tension, along the robot and {ASSUMED_FREE_LENGTH:g} times its length before it"
            )
        else:
            sentences.append(
                f"  lines of {', '.join(names)}: E A {stiffness:.0f} N, {free:g} mm from capstan to robot,"
                f" stretch {stretch:.2f} mm at the largest tension"
            )
    return sentences


def _mesh_error(described: "Robot", model: "RobotModel", sag: "Shape") -> dict[str, Any]:
    """Return the estimated error of a chosen mesh or of a file's, or how far the tip moves when the described one is refined."""
    import numpy as np

    from gravcomp.config import to_mapping
    from gravcomp.full_model.mesh_choice import ACCURACY, chosen_mesh
    from gravcomp.full_model.size_choice import chosen_estimate
    from gravcomp.simulation import Simulator

    robot = model.robot
    elements = robot.elements
    if elements is None:  # a body from a file that is not divided along its axis
        return _file_error(model, chosen_estimate(described))
    if described.elements is None:
        error = chosen_mesh(described).error
        return {
            "chosen_elements": {key: value for key, value in to_mapping(elements).items() if value is not None},
            "estimated_error_pct": 100 * error,
            "refinement": "fine enough" if error <= ACCURACY else f"the error is above {100 * ACCURACY:g} % of the length",
        }
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


def _file_error(model: "RobotModel", estimate: "MeshEstimate | None" = None) -> dict[str, Any]:
    """Return the estimated error of the mesh of a body from a file, and what to do about it.

    estimate: where it is known already.
    """
    import math

    from gravcomp.full_model.mesh_choice import ACCURACY
    from gravcomp.full_model.recovered_strain import estimated_error
    from gravcomp.mesh.division import why_not_swept

    estimate, body = estimate or estimated_error(model), model.robot.body
    assert body is not None
    if estimate is None:
        return {
            "estimated_error_pct": None,
            "refinement": "its error is not estimated (too large, or without an equilibrium): compare with a finer mesh",
        }
    if estimate.error <= ACCURACY:
        advice = "fine enough"
    else:
        fitting = 1e3 * estimate.element_length * math.sqrt(ACCURACY / estimate.error)
        where = f"along the robot around z = {1e3 * estimate.place:.0f} mm"
        reason = why_not_swept(model.robot)
        if body.placed().kind == "tri3":
            advice = f"tetrahedra fine enough, of {fitting:.2g} mm, take too long; hexahedra are not possible: {reason}"
        else:
            chosen = "or body.remesh: true, with which hexahedra are chosen"
            again = chosen if reason is None else "hexahedra of 20 nodes are the fewest"
            found = f"{fitting:.2g} mm in place of {1e3 * estimate.element_length:.2g} mm {where}"
            advice = f"too coarse; use elements of {found}; {again}"
    if estimate.released:
        advice += (
            "; with the cables released only: bent by them its error is not estimated, as they tie distant sections together"
        )
    return {"estimated_error_pct": 100 * estimate.error, "worst_load": estimate.load, "refinement": advice}


def _text(figures: dict[str, Any], hold_lines: list[str]) -> str:
    mesh, tip = figures["mesh"], figures["horizontal_tip_mm"]
    lines = [
        f"{figures['robot']} ({figures['file']})",
        f"  length {figures['length_mm']:.1f} mm, mass {figures['mass_g']:.2f} g (payload {figures['payload_g']:.2f} g)",
        "  cables " + ", ".join(f"{name} {cable['length_mm']:.1f} mm" for name, cable in figures["cables"].items()),
        *_lines(figures["cables"]),
        "  natural frequencies " + ", ".join(f"{f:.2f}" for f in figures["natural_frequency_hz"]) + " Hz",
        "  tip when horizontal, cables released: "
        + (figures["horizontal_message"] if tip is None else ", ".join(f"{x:.2f}" for x in tip) + " mm"),
    ]
    lines += [f"  {line}" for line in hold_lines]
    if figures["motors"] and figures["motors"]["advice"]:
        lines.append(f"  advice: {figures['motors']['advice']}")
    if figures["play"]:
        lines.append(f"  {'advice: ' if figures['play']['large'] else ''}{figures['play']['sentence']}")
    if figures["reach"]:
        lines += reach_text(figures["reach"])
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
    elif mesh.get("estimated_error_pct") is not None:
        lines.append(
            f"  mesh of the file: with twice as many elements each way the tip ({mesh['worst_load']}) moves by about"
            f" {mesh['estimated_error_pct']:.2g} % of the length: {mesh['refinement']}"
        )
    elif mesh.get("tip_change_when_refined_mm") is not None:
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
