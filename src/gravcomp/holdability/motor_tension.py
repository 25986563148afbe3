"""Whether the motors reach the tension that the limits of the robot allow the controller to command."""

from gravcomp.description.hardware import Hardware
from gravcomp.description.limits import Limits


def weak_motors(hardware: Hardware, limits: Limits) -> str:
    """Return that the motors reach less than `limits.tension_max`, and what helps, as a sentence; empty where they reach it."""
    reached, current = hardware.weakest_tension, hardware.drive.current_limit
    if reached >= limits.tension_max:
        return ""
    return (
        f"the motors pull {reached:.3g} N at most, at their current limit of {current:g} A, and the controller may command"
        f" robot.limits.tension_max, {limits.tension_max:g} N: raise hardware.drive.current_limit as far as the motors stand it,"
        " use smaller capstans, or lower tension_max"
    )
