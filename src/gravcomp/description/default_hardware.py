"""Motors for a robot whose file has none: one for each cable, as the limits of the robot ask. For the virtual robot only.

What the file gives in `hardware.drive` stays. The rest follows from `robot.limits`: tension, stroke and speed of the cables, and
a current limit that reaches the largest tension.
"""

from typing import Any

from gravcomp.description.hardware import MOTOR_IDS, Drive
from gravcomp.description.robot import Robot

_MARGIN = 1.5  # of the current limit over the largest tension's current, for the friction of gear and line
_BASE_PORT = 43113


def has_motors(section: dict[str, Any]) -> bool:
    """Return whether a section `hardware` names motors; a wrong value counts, and is refused when it is read."""
    return section.get("motors") is not None


def with_motors(section: dict[str, Any], robot: Robot) -> dict[str, Any]:
    """Return the section `hardware` (edge keys) with a motor for each cable of the robot."""
    drive = section.get("drive") or {}
    if not isinstance(drive, dict):
        return section
    limits, standard = robot.limits, Drive()
    tension = _number(drive, "tension_limit", limits.tension_max)
    radius, constant = _number(drive, "capstan_radius_mm", 1e3 * standard.capstan_radius), standard.torque_constant
    current = _MARGIN * tension * 1e-3 * radius / _number(drive, "torque_constant", constant)
    derived = {
        "tension_limit": min(tension, 100.0),
        "current_limit": round(min(max(current, standard.current_limit), 10.0), 3),
        "velocity_limit_mm_s": min(1e3 * limits.displacement_rate, 250.0),
        "displacement_min_mm": max(1e3 * limits.displacement_min, -200.0),
        "displacement_max_mm": min(1e3 * limits.displacement_max, 200.0),
    }
    names, most = robot.cable_names, len(MOTOR_IDS)
    motors: list[dict[str, Any]] = [{"cable": name, "can_id": 1 + index % most} for index, name in enumerate(names)]
    completed = {**section, "drive": {**derived, **drive}, "motors": motors}
    if len(names) > most and not section.get("buses"):
        count = -(-len(names) // most)
        completed["buses"] = [{"name": f"bus{k}", "channel": f"239.74.163.{2 + k}:{_BASE_PORT + k}"} for k in range(count)]
        for index, motor in enumerate(motors):
            motor["bus"] = f"bus{index // most}"
    return completed


def _number(mapping: dict[str, Any], key: str, default: float) -> float:
    value = mapping.get(key, default)
    return float(value) if isinstance(value, (int, float)) and value > 0 else default
