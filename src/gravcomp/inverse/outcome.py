"""Effect of a programme's solution, in one compiled call: tensions, command, limits reached and predicted errors."""

from typing import NamedTuple

import numpy as np
from numba import njit

from gravcomp.inverse.command import cable_displacement
from gravcomp.inverse.errors import TipErrors, tip_errors
from gravcomp.inverse.limits import held_within, limits_met
from gravcomp.inverse.scaling import unscaled


class Outcome(NamedTuple):
    """Effect of a solution.

    tension (m,) in N; change (m,): change of the path displacement in m; along and lengths: scalar product of this change and the
    last one, and product of their lengths, in m^2; displacement (m,): command in m; effector (e,): predicted; met (3, m) and
    any_met: of `limits.limits_met`; errors of the tip.
    """

    tension: np.ndarray
    change: np.ndarray
    along: float
    lengths: float
    displacement: np.ndarray
    effector: np.ndarray
    met: np.ndarray
    any_met: np.bool_
    errors: TipErrors


@njit(cache=True)
def outcome(
    compliance_aa: np.ndarray, displacement_free: np.ndarray, compliance_ea: np.ndarray, effector_free: np.ndarray,
    before: np.ndarray, solution: tuple, slack: float, previous: np.ndarray, last_change: np.ndarray, travel: tuple,
    highest: float, tip: np.ndarray, direction: np.ndarray,
) -> Outcome:  # fmt: skip
    """Return the effect of a solution.

    The first four arguments are the fields of `Response`; before (m,): tensions of the present state in N; solution: arguments
    of `scaling.unscaled`; slack in m; previous (m,): last command in m; last_change (m,): change of the last step in m; travel:
    longest way of a step, least and largest displacement in m; highest: largest tension in N; tip (3,) and direction (3,) of
    the target.
    """
    tension, unwanted = unscaled(*solution)
    reach, farthest_out, farthest_in = travel
    path = compliance_aa @ tension + displacement_free
    change = compliance_aa @ (tension - before)
    along, lengths = (change * last_change).sum(), np.sqrt((change * change).sum() * (last_change * last_change).sum())
    wanted = cable_displacement(path, compliance_aa, unwanted, slack)
    displacement = held_within(wanted, previous, reach, farthest_out, farthest_in)
    effector = compliance_ea @ tension + effector_free
    met, any_met = limits_met(displacement, previous, reach, farthest_out, farthest_in, tension, highest)
    errors = tip_errors(effector, tip, direction)
    return Outcome(tension, change, along, lengths, displacement, effector, met, any_met, errors)
