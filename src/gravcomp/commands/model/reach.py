"""How far each cable alone bends the weightless robot."""

import math
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np
    from scipy.spatial.transform import Rotation

    from gravcomp.simulation import Simulator

# Steps of the tension over its limit: the first, the longest, and the one below which the path of equilibria counts as ended.
_FIRST, _LONGEST, _LEAST = 1.0 / 64.0, 1.0 / 8.0, 1.0 / 256.0
_ITERATIONS = 10


def reach(simulator: "Simulator") -> list[dict[str, Any]]:
    """Return for each cable how far it bends the robot, with growing tension, and what ends that.

    Every entry has `ended_by`: the limit of tension or of displacement, `half turn` where the backbone is bent by more than that
    from its shape at rest, or `no equilibrium`. Its figures are those of the last equilibrium before; None if not even the
    smallest tension has one. `lateral_mm` is the longest way of the tip across z of soft_base, `tilt_deg` the angle between the
    directions of the tip there and at rest.
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
    sections = model.effectors.sections(model.mesh.nodes)
    tip, rest = sections[-1, 0], _rotations(sections)
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
        sections = model.effectors.sections(model.mesh.nodes + state.u)
        displacement = float(state.tendons.displacement[index] + model.tendons.stretch(state.tendons)[index] * tension[index])
        if displacement > limits.displacement_max:
            entry["ended_by"] = "displacement limit"
            break
        rotations = _rotations(sections)
        if _bend(rest, rotations) > math.pi:
            entry["ended_by"] = "half turn"
            break
        lateral = 1e3 * float(np.hypot(*(sections[-1, 0] - tip)[:2]))
        entry |= {
            "tension_n": float(tension[index]),
            "displacement_mm": 1e3 * displacement,
            "lateral_mm": max(lateral, entry["lateral_mm"] or 0.0),
            "tilt_deg": math.degrees(_angle(rest[-1], rotations[-1])),
        }
        left = beyond_range(model, state.u)
        if left and "law_range" not in entry:
            entry |= {"law_range_left_at_n": float(tension[index]), "law_range": left}
        here, part, step = state, next_part, min(2.0 * step, _LONGEST)
    solver.reset()
    return entry


def _rotations(sections: "np.ndarray") -> "Rotation":
    """Return the rotations of sections (n, 3, 3) from base to tip."""
    import numpy as np
    from scipy.spatial.transform import Rotation

    from gravcomp.full_model.observation import observe

    return Rotation.from_quat(observe(sections, np.zeros((*sections.shape, 0)))[2])


def _bend(rest: "Rotation", now: "Rotation") -> float:
    """Return by how much (rad) a backbone is bent from its shape at rest, all its sections added.

    Between two sections that is the angle between the direction of the farther one, in the axes of the nearer, now and at rest.
    """
    return float(_angle(rest[:-1].inv() * rest[1:], now[:-1].inv() * now[1:]).sum())


def _angle(one: "Rotation", other: "Rotation") -> "np.ndarray":
    """Return the angles in rad between the z axes of two rotations, or of two rows of them."""
    import numpy as np

    a, b = one.apply([0.0, 0.0, 1.0]), other.apply([0.0, 0.0, 1.0])
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), (a * b).sum(axis=-1))


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
