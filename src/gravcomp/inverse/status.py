"""State of the inverse controller; the codes are those of gravcomp_msgs/ControllerStatus."""

from enum import IntEnum

import numpy as np

from gravcomp.inverse.surroundings import NOTHING, Met
from gravcomp.inverse.target import Target


class ControllerCode(IntEnum):
    """Codes of gravcomp_msgs/ControllerStatus."""

    INACTIVE = 0
    OK = 1
    AT_LIMIT = 2
    UNREACHABLE = 3
    STALE = 4
    REFUSED = 5
    SOLVER_FAILED = 6
    RELAXING = 7
    CONTACT = 8
    ZONE = 9


class Holdable(IntEnum):
    """Values of `holdable` in gravcomp_msgs/ControllerStatus."""

    NOT_KNOWN = 0
    YES = 1
    NO = 2


def evaluate(
    *,
    target: Target,
    points_missed: float,
    tilt: float,
    met: np.ndarray | None,
    names: tuple[str, ...],
    tolerance: float,
    tilt_tolerance: float,
    contact: str = "",
    around: Met = NOTHING,
) -> tuple[ControllerCode, str]:
    """Return code and message for a step.

    points_missed: largest predicted distance of a weighted point in m; tilt in rad; met (3, m): of `limits.limits_met`, None if
    no limit is reached; names (m,) of the cables; tolerance (m) and tilt_tolerance (rad): up to which a target is reached;
    contact: what the robot leans on, in words; around: zones and forces that the step meets.
    """
    if around.entered:
        return ControllerCode.ZONE, f"{around.entered}: it is led out"
    if around.pressed:
        return ControllerCode.CONTACT, f"{around.pressed}: it is lowered as far as the cables can"
    moving, at_tension, at_travel = (_listed(names, which) for which in met) if met is not None else ("", "", "")
    held = [f"{what} of {which}" for what, which in (("tension", at_tension), ("displacement", at_travel)) if which]
    if moving and not held:
        return ControllerCode.AT_LIMIT, f"moving as fast as allowed: displacement rate of {moving}"
    reason = f"; at the limit: {', '.join(held)}" if held else ""
    missed = ControllerCode.CONTACT if contact else ControllerCode.UNREACHABLE
    reason += f"; the robot leans on {contact}" if contact else ""
    reason += f"; {around.force}" if around.force else ""
    if around.zone:
        missed = ControllerCode.ZONE
        reason += f"; the robot is kept out of {around.zone}"
    if points_missed > tolerance:
        return (
            missed,
            f"the nearest shape is {1e3 * points_missed:.1f} mm from the target (tolerance {1e3 * tolerance:g} mm){reason}",
        )
    if target.tip_direction_weight > 0.0 and tilt > tilt_tolerance:
        return (
            missed,
            f"the nearest shape is tilted by {np.degrees(tilt):.1f} deg (tolerance {np.degrees(tilt_tolerance):g} deg){reason}",
        )
    if held:
        return ControllerCode.AT_LIMIT, f"the nearest shape is kept{reason}"
    return ControllerCode.OK, "the target is kept"


def _listed(names: tuple[str, ...], which: np.ndarray) -> str:
    return ", ".join(name for name, yes in zip(names, which.tolist()) if yes)
