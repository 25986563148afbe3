"""Motors for a robot whose file has none, for the virtual robot only: one for each cable or for each joint of `hardware.joints`.

What the file gives in `hardware.drive` stays. The rest follows from `robot.limits`: tension, stroke and speed of the cables, and
motors that reach the largest tension. The capstans are so small that the backlash of the gears turns the tip little: a capstan of
radius c behind a gear with the backlash b leaves a cable at the distance r from the axis open by b c, and the tip by b c / r. The
gains of the position loops are those of the same rotor. Homing takes a cable as taut at half of the largest tension, or at what
the current shows. Joints of a ros2_control robot are real motors: capstans that nobody has described are the standard ones there.
"""

import math
from typing import Any

from gravcomp.description.hardware import MOTOR_IDS, Drive, Homing
from gravcomp.description.own_weight import bend_by_own_weight, largest_pitch_radius
from gravcomp.description.robot import Robot

_MARGIN = 1.5  # of the current limit over the largest tension's current, for the friction of gear and line
_LARGEST_CURRENT = 10.0  # A, of a C610
_PLAY = 0.02  # turn of the tip by the backlash of a gear, over the turn by the robot's weight
_SMALLEST_CAPSTAN = 0.2e-3  # m: of a lead screw with a lead of 1.26 mm
_HOMING = 0.5  # of the largest tension, at which homing takes a cable as taut
_LEAST_RISE = 0.01  # A, of homing, that stands well out of the noise of a C610's current
_SPEED = 28.0  # rad/s of a small capstan: half of what an M2006 does without load
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
    backlash = (
        0.0 if drive.get("backlash_deg") == 0 else math.radians(_number(drive, "backlash_deg", math.degrees(standard.backlash)))
    )
    suited = standard.capstan_radius if section.get("joints") else _capstan_radius(robot, backlash, standard.capstan_radius)
    radius = 1e-3 * _number(drive, "capstan_radius_mm", 1e3 * suited)
    torque = _MARGIN * tension * radius
    constant = max(standard.torque_constant, math.ceil(1e3 * torque / _LARGEST_CURRENT) * 1e-3)
    used = _number(drive, "torque_constant", constant)
    current = torque / used
    size = standard.capstan_radius / radius
    derived = {
        "tension_limit": tension,
        "current_limit": round(min(max(current, standard.current_limit), _LARGEST_CURRENT), 3),
        "velocity_limit_mm_s": min(1e3 * limits.displacement_rate, 1e3 * _SPEED * radius if size > 1.0 else 250.0),
        "displacement_min_mm": 1e3 * limits.displacement_min,
        "displacement_max_mm": 1e3 * limits.displacement_max,
    }
    if constant > standard.torque_constant:
        derived["torque_constant"] = constant
    if size > 1.0:
        derived |= {
            "capstan_radius_mm": 1e3 * radius,
            "velocity_gain": size * standard.velocity_gain,
            "velocity_integral": size * standard.velocity_integral,
        }
    most = len(MOTOR_IDS)
    motors = [{**cables, "can_id": 1 + index % most} for index, cables in enumerate(_cables_of_motors(section, robot))]
    completed = {**section, "drive": {**derived, **drive}, "motors": motors}
    homing = section.get("homing") or {}
    if isinstance(homing, dict):
        rise = min(_HOMING * limits.tension_max * radius / used, Homing().current_rise)
        completed["homing"] = {"current_rise": round(max(rise, _LEAST_RISE), 4), **homing}
    if len(motors) > most and not section.get("buses"):
        count = -(-len(motors) // most)
        completed["buses"] = [{"name": f"bus{k}", "channel": f"239.74.163.{2 + k}:{_BASE_PORT + k}"} for k in range(count)]
        for index, motor in enumerate(motors):
            motor["bus"] = f"bus{index // most}"
    return completed


def _capstan_radius(robot: Robot, backlash: float, standard: float) -> float:
    """Return a radius in m, at most the standard one, with which a backlash in rad turns the tip by no more than `_PLAY`."""
    bend, pitch = bend_by_own_weight(robot), largest_pitch_radius(robot)
    if bend is None or pitch == 0.0 or backlash == 0.0:
        return standard
    fine = _PLAY * bend * pitch / backlash
    return standard if fine >= standard else max(math.floor(1e5 * fine) * 1e-5, _SMALLEST_CAPSTAN)


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
