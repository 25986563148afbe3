"""The command to the winches, computed from tensions.

A taut cable is wound to its path, u = delta = W_aa lambda + delta_free. An idle cable is paid out along its path, u = delta -
slack, because a cable of fixed length would hold the robot up as soon as its path lengthens. Between the two u is continuous:
the slack grows with the tension that the programme would take away if a cable could push, at the cable's own compliance. So
nothing jumps when a cable becomes idle. A cable that has to keep a tension is never idle.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from gravcomp.contact.contacts import ObstacleForces
from gravcomp.inverse.status import ControllerCode


class Command(NamedTuple):
    """A command, with the predicted error to the target.

    displacement (m,) in m and tension (m,) in N of the cables; code and message: state of the controller; solve_time in s;
    distance, lateral and axial in m and tilt in rad: predicted errors of the tip, NaN if nothing is predicted; tip (3,) in m:
    predicted, the nearest to the target that this step reaches; forces: on the obstacles that the model touches.
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
    tip: np.ndarray = np.full(3, np.nan)
    forces: ObstacleForces = ObstacleForces.none()


@njit(cache=True)
def cable_displacement(path: np.ndarray, compliance: np.ndarray, unwanted: np.ndarray, slack: float) -> np.ndarray:
    """Return the displacement (m,) of the winches in m.

    path (m,): predicted path displacement in m; compliance (m, m) in m/N; unwanted (m,): tension in N that the programme would
    take away if cables could push; slack: largest slack of an idle cable in m.
    """
    return path - np.minimum(slack, np.diag(compliance) * unwanted)
