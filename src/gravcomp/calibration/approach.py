"""How the pulls of a plan end: slower and slower, so that no motor runs past its goal.

A motor that runs past its goal turns back inside the backlash of its gear. Where the cable pulls less than the capstan rubs, the
capstan stays behind, and the cable is shorter than its winch says, by up to the backlash. A cable that is only wound in ends on
the flank that winds in, as after homing.
"""

import math

import numpy as np

from gravcomp.description import Limits
from gravcomp.inverse.limits import within_limits

_LAG = 0.1  # s, over the distance that is left: some times what a position loop lags behind
_SLOWEST = 5e-3  # of the largest rate

APPROACH = _LAG * (1.0 - math.log(_SLOWEST))
"""Time in s that the end of a pull takes."""


def approached(goal: np.ndarray, previous: np.ndarray, limits: Limits, interval: float) -> np.ndarray:
    """Return the displacements (m,) in m after `interval` s on the way from `previous` (m,) to `goal` (m,), within the limits."""
    left = goal - previous
    rate = np.clip(np.abs(left) / _LAG, _SLOWEST * limits.displacement_rate, limits.displacement_rate)
    return within_limits(previous + np.clip(left, -rate * interval, rate * interval), previous, limits, interval)
