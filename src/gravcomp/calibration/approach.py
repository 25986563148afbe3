"""How the pulls of a plan move the cables: no faster than the motors follow, and at the end slower and slower.

A rest begins where the commands rest. Motors of small capstans that are still winding then would show as a body that creeps.

A motor that runs past its goal turns back inside the backlash of its gear. Where the cable pulls less than the capstan rubs, the
capstan stays behind, and the cable is shorter than its winch says, by up to the backlash. A cable that is only wound in ends on
the flank that winds in, as after homing.
"""

import dataclasses
import math

import numpy as np

from gravcomp.description import Limits, Robot
from gravcomp.description.hardware import Hardware
from gravcomp.inverse.limits import within_limits

_LAG = 0.1  # s, over the distance that is left: some times what a position loop lags behind
_SLOWEST = 5e-3  # of the largest rate
_FOLLOWED = 0.9  # of the motors' largest speed: a loop at its limit falls behind

APPROACH = _LAG * (1.0 - math.log(_SLOWEST))
"""Time in s that the end of a pull takes."""


def as_pulled(robot: Robot, hardware: Hardware) -> Robot:
    """Return the robot with a largest rate of its cables that its motors follow."""
    ratios = np.abs(hardware.transmission.matrix)
    slowest = float(ratios.sum(axis=1).min(initial=1.0, where=ratios.any(axis=1)))
    rate = min(robot.limits.displacement_rate, _FOLLOWED * slowest * hardware.drive.velocity_limit)
    return dataclasses.replace(robot, limits=dataclasses.replace(robot.limits, displacement_rate=rate))


def approached(goal: np.ndarray, previous: np.ndarray, limits: Limits, interval: float) -> np.ndarray:
    """Return the displacements (m,) in m after `interval` s on the way from `previous` (m,) to `goal` (m,), within the limits."""
    left = goal - previous
    rate = np.clip(np.abs(left) / _LAG, _SLOWEST * limits.displacement_rate, limits.displacement_rate)
    return within_limits(previous + np.clip(left, -rate * interval, rate * interval), previous, limits, interval)
