"""What a robot file leaves out of `hardware`: motors, capstans and channels, so that the virtual robot can do without them.

Without motors there is one for each cable or for each joint of `hardware.joints`. What the file gives in `hardware.drive` stays;
the rest follows from `robot.limits`: tension, stroke and speed of the cables, and motors that reach the largest tension. For the
capstans see `suited_capstan`. Buses without a channel get one each.
"""

import math
from typing import Any

from gravcomp.description.hardware import MOTOR_IDS, Drive
from gravcomp.description.robot import Robot
from gravcomp.description.suited_capstan import (
    MARGIN,
    capstan_radius,
    drive_of,
    fastest,
    has_motors,
    homing_of,
    number,
    with_capstans,
)

_LARGEST_CURRENT = 10.0  # A, of a C610
_BASE_PORT = 43113
_RIGGING = ("cable", "ratio", "pair", "also", "preload_mm", "differential")  # keys that say which cables a motor moves


def completed(section: dict[str, Any], robot: Robot) -> dict[str, Any]:
    """Return the section `hardware` (edge keys) with what it leaves out; wrong values stay, to be refused when they are read."""
    section = with_channels(section)
    return with_capstans(section, robot) if has_motors(section) else with_motors(section, robot)


def with_channels(section: dict[str, Any]) -> dict[str, Any]:
    """Return the section `hardware` (edge keys) with a channel for each of several buses without interface and channel."""
    buses = section.get("buses")
    if not isinstance(buses, list) or len(buses) < 2:
        return section
    named = [
        {**bus, "channel": _channel(k)} if isinstance(bus, dict) and not {"interface", "channel"} & bus.keys() else bus
        for k, bus in enumerate(buses)
    ]
    return {**section, "buses": named}


def with_motors(section: dict[str, Any], robot: Robot) -> dict[str, Any]:
    """Return the section `hardware` (edge keys) with a motor for each cable of the robot."""
    drive = section.get("drive") or {}
    if not isinstance(drive, dict):
        return section
    limits, standard = robot.limits, Drive()
    tension = number(drive, "tension_limit", limits.tension_max)
    radius = capstan_radius(section, robot)
    speed = fastest(radius, section)
    torque = MARGIN * tension * radius
    constant = max(standard.torque_constant, math.ceil(1e3 * torque / _LARGEST_CURRENT) * 1e-3)
    used = number(drive, "torque_constant", constant)
    derived = {
        "tension_limit": tension,
        "current_limit": round(min(max(torque / used, standard.current_limit), _LARGEST_CURRENT), 3),
        "velocity_limit_mm_s": 1e3 * min(limits.displacement_rate, speed),
        "displacement_min_mm": 1e3 * limits.displacement_min,
        "displacement_max_mm": 1e3 * limits.displacement_max,
    } | drive_of(radius, drive)
    if constant > standard.torque_constant:
        derived["torque_constant"] = constant
    most = len(MOTOR_IDS)
    motors = [{**cables, "can_id": 1 + index % most} for index, cables in enumerate(_cables_of_motors(section, robot))]
    found = {**section, "drive": {**derived, **drive}, "motors": motors}
    homing = section.get("homing") or {}
    if isinstance(homing, dict):
        found["homing"] = {**homing_of(radius, used, speed, robot), **homing}
    if len(motors) > most and not section.get("buses"):
        count = -(-len(motors) // most)
        found["buses"] = [{"name": f"bus{k}", "channel": _channel(k)} for k in range(count)]
        for index, motor in enumerate(motors):
            motor["bus"] = f"bus{index // most}"
    return found


def _channel(index: int) -> str:
    """Return the channel of a bus in software, by its number."""
    return f"239.74.163.{2 + index}:{_BASE_PORT + index}"


def _cables_of_motors(section: dict[str, Any], robot: Robot) -> list[dict[str, Any]]:
    """Return what each motor moves: what each of `hardware.joints.motors` moves, where it is given, else one cable each."""
    joints = section.get("joints")
    given = joints.get("motors") if isinstance(joints, dict) else None
    if isinstance(given, list) and all(isinstance(motor, dict) for motor in given):
        return [{key: motor[key] for key in _RIGGING if key in motor} for motor in given]
    return [{"cable": name} for name in robot.cable_names]
