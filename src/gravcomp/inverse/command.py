"""From tensions to what the winches shall do.

A taut cable is wound to its path, u = delta = W_aa lambda + delta_free. An idle cable is paid out along its path, u =
delta - slack, because a cable that is held at a fixed length holds the robot up by itself as soon as its path wants to
lengthen. Between the two u is continuous: the slack opens with the tension that the programme would take away if a
cable could push, at the cable's own compliance, so nothing jumps when a cable goes idle.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from gravcomp.inverse.status import ControllerCode


class Command(NamedTuple):
    """displacement (m,) m and tension (m,) N of the cables; code and message say how well the target is kept;
    distance, lateral, axial m and tilt rad: what is predicted of the tip against its target (NaN: nothing); solve_time s.
    """

    displacement: np.ndarray
    tension: np.ndarray
    code: ControllerCode
    message: str
    solve_time: float
    distance: float = np.nan
    lateral: float = np.nan
    axial: float = np.nan
    tilt: float = np.nan


@njit(cache=True)
def cable_displacement(path: np.ndarray, compliance: np.ndarray, unwanted: np.ndarray, slack: float) -> np.ndarray:
    """Displacement (m,) of the winches for the predicted path displacement (m,), the cables' compliance (m, m) and how much tension
    (m,) the programme would take away if they could push.
    """
    return path - np.minimum(slack, np.diag(compliance) * unwanted)
