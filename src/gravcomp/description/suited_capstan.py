"""Capstans that suit the robot, where a file describes none, with the position loops and the homing of the same rotor.

The capstans are so small that the backlash of the gears turns the tip little: a capstan of radius c behind a gear with the
backlash b leaves a cable at the distance r from the axis open by b c, and the tip by b c / r. Those of described motors also
reach the largest tension with the current that the file allows. Homing takes a cable as taut at half of the largest tension, or
at what the current shows. The rotor of a small capstan turns no faster than that of the standard drive: the angle wraps at a
turn, so that feedback every 2 ms, which may be 8 ms late, no longer tells the turns at twice that speed. Joints of a
ros2_control robot are real motors: capstans that nobody has described are the standard ones there.
"""

import math
from typing import Any

from gravcomp.description.drive import Drive, Homing
from gravcomp.description.own_weight import bend_by_own_weight, largest_pitch_radius
from gravcomp.description.robot import Robot

MARGIN = 1.5
"""Current limit over the current of the largest tension, for the friction of gear and line."""

_PLAY = 0.02  # turn of the tip by the backlash of a gear, over the turn by the robot's weight
_SMALLEST = 0.2e-3  # m: of a lead screw with a lead of 1.26 mm
_SPEED = 28.0  # rad/s of a small capstan of a joint: half of what an M2006 does without load
_FASTEST = 0.25  # m/s of a cable that a joint winds
_HOMING = 0.5  # of the largest tension, at which homing takes a cable as taut
_LEAST_RISE = 0.01  # A, of homing, that stands well out of the noise of a C610's current


def has_motors(section: dict[str, Any]) -> bool:
    """Return whether a section `hardware` names motors; a wrong value counts, and is refused when it is read."""
    return section.get("motors") is not None


def capstan_radius(section: dict[str, Any], robot: Robot) -> float:
    """Return the radius in m of the capstans: the described one, else one that suits robot, motors and gears.

    That is at most the standard one. section: `hardware` (edge keys).
    """
    drive, standard = section.get("drive") or {}, Drive()
    if "capstan_radius_mm" in drive:
        return 1e-3 * number(drive, "capstan_radius_mm", 1e3 * standard.capstan_radius)
    if section.get("joints") is not None:
        return standard.capstan_radius
    backlash = (
        0.0 if drive.get("backlash_deg") == 0 else math.radians(number(drive, "backlash_deg", math.degrees(standard.backlash)))
    )
    largest = standard.capstan_radius
    bend = bend_by_own_weight(robot) if backlash > 0.0 else None
    pitch = 0.0 if bend is None else largest_pitch_radius(robot)
    if bend is not None and pitch > 0.0:
        largest = min(largest, _PLAY * bend * pitch / (backlash * _largest_ratio(section)))
    if has_motors(section):
        current = number(drive, "current_limit", standard.current_limit)
        torque = current * number(drive, "torque_constant", standard.torque_constant)
        largest = min(largest, torque / (MARGIN * robot.limits.tension_max))
    return largest if largest == standard.capstan_radius else max(math.floor(1e5 * largest) * 1e-5, _SMALLEST)


def drive_of(radius: float, drive: dict[str, Any]) -> dict[str, Any]:
    """Return the keys of the section `drive` (edge keys) for small capstans of this radius in m: the loops of the same rotor."""
    standard = Drive()
    size = standard.capstan_radius / radius
    if size <= 1.0:
        return {}
    gains = {"velocity_gain": size * standard.velocity_gain, "velocity_integral": size * standard.velocity_integral}
    assumed = {} if "capstan_radius_mm" in drive else {"capstan_radius_mm": 1e3 * radius, "capstan_assumed": True}
    return gains | assumed


def fastest(radius: float, section: dict[str, Any]) -> float:
    """Return the largest speed in m/s of a cable on capstans of this radius in m: at that of the standard drive's rotor.

    section: `hardware` (edge keys), of which the gear ratio counts. Joints count their turns themselves.
    """
    standard = Drive()
    if section.get("joints") is not None:
        return _SPEED * radius if radius < standard.capstan_radius else _FASTEST
    ratio = number(section.get("drive") or {}, "gear_ratio", standard.gear_ratio)
    return standard.velocity_limit * (radius / standard.capstan_radius) * (standard.gear_ratio / ratio)


def homing_of(radius: float, torque_constant: float, speed: float, robot: Robot) -> dict[str, float]:
    """Return the section `homing` (edge keys) of motors with capstans of this radius in m, and N m/A at the gear's output.

    speed: the largest of a cable, in m/s.
    """
    standard = Homing()
    rise = min(_HOMING * robot.limits.tension_max * radius / torque_constant, standard.current_rise)
    return {"current_rise": round(max(rise, _LEAST_RISE), 4), "velocity_mm_s": 1e3 * min(standard.velocity, speed)}


def with_capstans(section: dict[str, Any], robot: Robot) -> dict[str, Any]:
    """Return the section `hardware` (edge keys) of described motors with what follows from small capstans, given or not."""
    drive, homing, standard = section.get("drive") or {}, section.get("homing") or {}, Drive()
    if not isinstance(drive, dict) or not isinstance(homing, dict):
        return section
    radius = capstan_radius(section, robot)
    speed = fastest(radius, section)
    if radius >= standard.capstan_radius and speed >= standard.velocity_limit:
        return section
    limited = {"velocity_limit_mm_s": 1e3 * min(standard.velocity_limit, speed), **drive}
    if radius >= standard.capstan_radius:
        return {**section, "drive": limited}
    constant = number(drive, "torque_constant", standard.torque_constant)
    return {
        **section,
        "drive": {**drive_of(radius, drive), **limited},
        "homing": {**homing_of(radius, constant, speed, robot), **homing},
    }


def number(mapping: dict[str, Any], key: str, default: float) -> float:
    """Return a positive number of the mapping, or the default where it has none; wrong values are refused elsewhere."""
    value = mapping.get(key, default)
    return float(value) if isinstance(value, (int, float)) and value > 0 else default


def _largest_ratio(section: dict[str, Any]) -> float:
    """Return the largest displacement of a cable over that at the capstan, of the motors as they are read; 1 without motors."""
    motors = section.get("motors") or []
    found = [1.0]
    for motor in motors if isinstance(motors, list) else []:
        if isinstance(motor, dict):
            also = motor.get("also") or {}
            ratios = [motor.get("ratio"), *(also.values() if isinstance(also, dict) else [])]
            found += [abs(value) for value in ratios if isinstance(value, (int, float))]
    return max(found)
