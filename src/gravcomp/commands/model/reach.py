"""How far each cable alone bends the weightless robot."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gravcomp.simulation import Simulator

# Steps of the tension over its limit: the first, the longest, and the one below which the path of equilibria counts as ended.
_FIRST, _LONGEST, _LEAST = 1.0 / 64.0, 1.0 / 8.0, 1.0 / 256.0
_ITERATIONS = 10


def reach(simulator: "Simulator") -> list[dict[str, Any]]:
    """Return for each cable how far it bends the robot, with growing tension, and what ends that.

    Every entry has `ended_by`: the limit of tension or of displacement, `half turn` where the tip turns back, or `no
    equilibrium`. Its figures are those of the last equilibrium that was found; None if not even the smallest tension has one.
    """
    return [_reach_of(simulator, index) for index in range(len(simulator.robot.cables))]


def _reach_of(simulator: "Simulator", index: int) -> dict[str, Any]:
    import numpy as np

    from gravcomp.full_model.cable_input import CableInput
    from gravcomp.full_model.law_range import beyond_range

    robot, solver, model = simulator.robot, simulator.solver, simulator.model
    limits = robot.limits
    entry: dict[str, Any] = {"cable": robot.cable_names[index], "ended_by": "tension limit"}
    entry |= dict.fromkeys(("tension_n", "displacement_mm", "lateral_mm", "tilt_deg"))
    solver.reset()
    here, part, step = solver.state, 0.0, _FIRST
    while part < 1.0:
        next_part = min(1.0, part + step)
        tension = np.zeros(len(robot.cables))
        tension[index] = next_part * limits.tension_max
        state = solver.track(np.zeros(3), CableInput(tension=tension), iterations=_ITERATIONS)
        if not state.converged:
            solver.state = here
            step /= 2.0
            if step < _LEAST:
                entry["ended_by"] = "no equilibrium"
                break
            continue
        section = model.effectors.sections(model.mesh.nodes + state.u)[-1]
        direction = np.cross(section[1], section[2])
        tilt = float(np.degrees(np.arccos(np.clip(direction[2] / np.linalg.norm(direction), -1.0, 1.0))))
        displacement = float(state.tendons.displacement[index] + model.tendons.stretch(state.tendons)[index] * tension[index])
        if displacement > limits.displacement_max:
            entry["ended_by"] = "displacement limit"
            break
        if tilt < (entry["tilt_deg"] or 0.0):
            entry["ended_by"] = "half turn"
            break
        lateral = 1e3 * float(np.hypot(*section[0, :2]))
        entry |= {
            "tension_n": float(tension[index]),
            "displacement_mm": 1e3 * displacement,
            "lateral_mm": max(lateral, entry["lateral_mm"] or 0.0),
            "tilt_deg": tilt,
        }
        left = beyond_range(model, state.u)
        if left and "law_range" not in entry:
            entry |= {"law_range_left_at_n": float(tension[index]), "law_range": left}
        here, part, step = state, next_part, min(2.0 * step, _LONGEST)
    solver.reset()
    return entry


def text(entries: list[dict[str, Any]]) -> list[str]:
    """Return the reach as lines."""
    found = ["  reach of each cable alone, without gravity:"]
    for entry in entries:
        if entry["tension_n"] is None:
            found.append(f"    {entry['cable']}: not found, {entry['ended_by']} at the smallest tension tried")
            continue
        found.append(
            f"    {entry['cable']}: {entry['lateral_mm']:.1f} mm lateral, tip tilted by {entry['tilt_deg']:.0f} deg,"
            f" at {entry['tension_n']:.2f} N and {entry['displacement_mm']:.1f} mm; ended by: {entry['ended_by']}"
        )
        if "law_range" in entry:
            found.append(f"      warning: at {entry['law_range_left_at_n']:.2f} N {entry['law_range']}")
    return found
