"""The answer as a mapping for `--json`; the tutorial of the documents lists the keys."""

from typing import Any

import numpy as np

from gravcomp.description import Robot
from gravcomp.holdability.answer import DirectionAnswer, Holdability
from gravcomp.holdability.directions import angles
from gravcomp.holdability.text import sentence


def as_json(robot: Robot, answer: Holdability) -> dict[str, Any]:
    """Return the answer with lengths in mm and angles in degrees; what is not known is None."""
    needed = answer.needed
    return {
        "held": answer.held,
        "held_share": answer.held_share,
        "known": answer.held or answer.refuted,
        "sentence": sentence(robot, answer),
        "model": answer.model,
        "tolerance_mm": 1e3 * answer.tolerance,
        "released_lateral_mm": _mm(answer.released),
        "buckling_gravity": answer.buckling,
        "buckling_direction": None if answer.buckling_direction is None else answer.buckling_direction.tolist(),
        "needed": None
        if needed is None
        else {
            "tension_n": needed.tension,
            "tension_factor": None if needed.tension is None else needed.tension / answer.tension_max,
            "displacement_mm": _mm(needed.displacement),
            "radius_factor": needed.radius_factor,
            "radius_fits": needed.radius_fits,
            "widest_radius_factor": needed.widest_factor,
            "widest_radius_tension_n": needed.widest_tension,
        },
        "worst": _direction(answer.directions[answer.worst]),
        "directions": [_direction(direction) for direction in answer.directions],
    }


def _direction(answer: DirectionAnswer) -> dict[str, Any]:
    inclination, azimuth = np.degrees(angles(answer.direction))
    return {
        "gravity_direction": answer.direction.tolist(),
        "inclination_deg": inclination,
        "azimuth_deg": azimuth,
        "held": answer.held,
        "known": answer.known,
        "share": answer.share,
        "binding": answer.binding.value,
        "cable": answer.cable,
        "cause": answer.cause,
        "demand": answer.demand,
        "tension_n": answer.tension,
        "displacement_mm": _mm(answer.displacement),
        "lateral_mm": _mm(answer.lateral),
        "eigenvalue": answer.eigenvalue,
        "eigenvalue_cables_held": answer.eigenvalue_held,
        "path_ends_at": answer.end,
    }


def _mm(value: float | None) -> float | None:
    return None if value is None else 1e3 * value
