"""`gravcomp model solve ROBOT`: one equilibrium, with its shape and cables."""

import argparse
from typing import TYPE_CHECKING, Any

from gravcomp.commands import output
from gravcomp.commands.model.loading import add_load_arguments, loaded_shape
from gravcomp.commands.model.wrenches import wrenches_of

if TYPE_CHECKING:
    from gravcomp.full_model.wrench import Wrench


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the subcommand's arguments."""
    add_load_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Run the subcommand. Returns 0: solved, 1: no equilibrium was found. Raises ConfigError, ValueError, MeshError."""
    import numpy as np

    from gravcomp.scene.declared import ITSELF

    simulator, shape, command = loaded_shape(args)
    figures = {
        "robot": simulator.robot.name,
        "model": shape.model,
        "status": shape.status.name.lower(),
        "message": shape.message,
        "gravity": shape.gravity.tolist(),
        "wrenches": [_described(wrench) for wrench in wrenches_of(args)],
        "tip_position_mm": (1e3 * shape.tip_position).tolist(),
        "tip_orientation_xyzw": shape.tip_orientation.tolist(),
        "tip_direction": shape.tip_direction.tolist(),
        "backbone_station": shape.backbone_station.tolist(),
        "backbone_position_mm": (1e3 * shape.backbone_position).tolist(),
        "cables": list(simulator.robot.cable_names),
        "tension_n": shape.cable_tension.tolist(),
        "displacement_mm": (1e3 * shape.cable_displacement).tolist(),
        "residual_n": shape.residual,
        "error_estimate_mm": 1e3 * shape.error_estimate,
        "solve_time_ms": 1e3 * shape.solve_time,
    }
    if simulator.scene:
        for note in simulator.scene.notes:
            output.note(note)
        contacts = shape.contacts
        figures["contacts"] = [
            {
                "obstacle": contacts.names[i],
                "station": contacts.station[i],
                **({"against_station": contacts.against[i]} if contacts.names[i] == ITSELF else {}),
                "position_mm": (1e3 * contacts.position[i]).tolist(),
                "gap_mm": 1e3 * contacts.gap[i],
                "force_n": contacts.force[i].tolist(),
                "normal_force_n": contacts.normal_force[i],
                "sliding": bool(contacts.sliding[i]),
            }
            for i in range(len(contacts))
        ]
    if command is not None:
        error = 1e3 * (shape.tip_position - 1e-3 * np.array(args.target))
        figures |= {
            "target_mm": list(args.target),
            "target_distance_mm": float(np.linalg.norm(error)),
            "controller": command.code.name.lower(),
            "controller_message": command.message,
        }
    output.result(figures, _text(figures))
    return 1 if figures["status"] in ("not_converged", "failed") else 0


def _described(wrench: "Wrench") -> dict[str, Any]:
    return {
        "force_n": wrench.force.tolist(),
        "moment_nm": wrench.moment.tolist(),
        "station": wrench.station,
        "frame": "follower" if wrench.follower else "fixed",
    }


def _against(contact: dict[str, Any]) -> str:
    return f" against {contact['against_station']:.3f}" if "against_station" in contact else ""


def _text(figures: dict[str, Any]) -> str:
    def row(values: list, digits: int = 3) -> str:
        return ", ".join(f"{value:.{digits}f}" for value in values)

    lines = [
        f"{figures['robot']}, {figures['model']} model: {figures['status']} {figures['message']}".rstrip(),
        f"  tip {row(figures['tip_position_mm'])} mm, direction {row(figures['tip_direction'], 4)}",
    ]
    for wrench in figures["wrenches"]:
        axes = "its section" if wrench["frame"] == "follower" else "soft_base"
        lines.append(
            f"  wrench at {wrench['station']:.2f} in the axes of {axes}:"
            f" {row(wrench['force_n'], 4)} N, {row(wrench['moment_nm'], 5)} N m"
        )
    if "target_mm" in figures:
        message = figures["controller_message"]
        lines.append(
            f"  {figures['target_distance_mm']:.3f} mm from the target; controller: {figures['controller']} {message}".rstrip()
        )
    lines += [
        f"  {name}: {tension:.4f} N, {displacement:+.3f} mm"
        for name, tension, displacement in zip(figures["cables"], figures["tension_n"], figures["displacement_mm"])
    ]
    if "contacts" in figures:
        lines.append(f"  {len(figures['contacts'])} contacts (station: x, y, z in mm; gap; force in N)")
        lines += [
            f"    {c['obstacle']}, {c['station']:.3f}{_against(c)}: {row(c['position_mm'])}; {1e3 * c['gap_mm']:+.2f} um;"
            f" {row(c['force_n'], 4)} ({c['normal_force_n']:.4f} N normal{', slides' if c['sliding'] else ''})"
            for c in figures["contacts"]
        ]
    lines.append(f"  residual {figures['residual_n']:.1e} N, {figures['solve_time_ms']:.2f} ms")
    lines.append("  backbone (station: x, y, z in mm)")
    lines += [f"    {s:.2f}: {row(p)}" for s, p in zip(figures["backbone_station"], figures["backbone_position_mm"])]
    return "\n".join(lines)
