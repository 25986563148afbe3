"""Motors for a robot whose file has none, for the virtual robot only: one for each cable or for each joint of `hardware.joints`.

What the file gives in `hardware.drive` stays. The rest follows from `robot.limits`: tension, stroke and speed of the cables, and
a current limit that reaches the largest tension.
"""

from typing import Any

from gravcomp.description.hardware import MOTOR_IDS, Drive
from gravcomp.description.robot import Robot

_MARGIN = 1.5  # of the current limit over the largest tension's current, for the friction of gear and line
_BASE_PORT = 43113
_RIGGING = ("cable", "ratio", "pair", "also", "preload_mm", "differential")  # keys that say which cables a motor moves


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
    most = len(MOTOR_IDS)
    motors = [{**cables, "can_id": 1 + index % most} for index, cables in enumerate(_cables_of_motors(section, robot))]
    completed = {**section, "drive": {**derived, **drive}, "motors": motors}
    if len(motors) > most and not section.get("buses"):
        count = -(-len(motors) // most)
        completed["buses"] = [{"name": f"bus{k}", "channel": f"239.74.163.{2 + k}:{_BASE_PORT + k}"} for k in range(count)]
        for index, motor in enumerate(motors):
            motor["bus"] = f"bus{index // most}"
    return completed


def _cables_of_motors(section: dict[str, Any], robot: Robot) -> list[dict[str, Any]]:
    """Return what each motor moves: what each of `hardware.joints.motors` moves, where it is given, else one cable each."""
    joints = section.get("joints")
    given = joints.get("motors") if isinstance(joints, dict) else None
    if isinstance(given, list) and all(isinstance(motor, dict) for motor in given):
        return [{key: motor[key] for key in _RIGGING if key in motor} for motor in given]
    return [{"cable": name} for name in robot.cable_names]


def _number(mapping: dict[str, Any], key: str, default: float) -> float:
    value = mapping.get(key, default)
    return float(value) if isinstance(value, (int, float)) and value > 0 else default
