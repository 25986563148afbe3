"""The inverse problem of one step as a quadratic programme in the cables' tensions (its solution is in `solver`).

The model answers linearly around its present state, effector e = W_ea lambda + e_free and path displacement delta =
W_aa lambda + delta_free. The tensions lambda that bring the effector nearest to its target solve (after Coevoet,
Escande and Duriez, IEEE RA-L 2017)

    min   |M (W_ea lambda + e_free - e_target)|^2  +  c (eps lambda^T W_aa lambda  +  rho |lambda - lambda_now|_D^2)
    s.t.  tension_lower <= lambda <= tension_upper,
          displacement_lower <= W_aa lambda + delta_free <= displacement_upper,

with M the roots of the weights, D the diagonal of W_aa, and c = trace(W_ea^T M^T M W_ea) / trace(W_aa), which makes eps
and rho numbers that suit any robot. The energy eps picks, among tensions of equal effect, those without cables that
work against each other; the proximal term rho makes the sequence of steps, a Gauss-Newton iteration, settle (see
`damping`). Of the errors of tip and backbone the part along the robot counts less, because cables only pull: they
cannot make up for the length that they take. At the tip that is the part along the target's direction, less the more the tip still points
elsewhere.
"""

import math
from typing import TYPE_CHECKING

import numpy as np
from numba import njit

from gravcomp.description import Limits
from gravcomp.inverse.limits import step_bounds
from gravcomp.inverse.options import InverseOptions
from gravcomp.inverse.scaling import Programme, ScaledProgramme, scaled
from gravcomp.inverse.target import Target

if TYPE_CHECKING:
    from gravcomp.full_model.shape import Response


def build_programme(
    response: "Response",
    target: Target,
    limits: Limits,
    *,
    tension: np.ndarray,
    displacement: np.ndarray,
    backbone_station: np.ndarray,
    interval: float,
    damping: float,
    options: InverseOptions,
) -> ScaledProgramme:
    """The programme around the present state, for the next `interval` (s).

    tension (m,): the present tensions, reference of the proximal term; displacement (m,): commanded last; backbone_station (n,): of
    the effector's backbone rows; damping: factor of the proximal term.
    """
    return _built(
        np.ascontiguousarray(response.compliance_ea),
        response.effector_free,
        np.ascontiguousarray(response.compliance_aa),
        response.displacement_free,
        tension,
        displacement,
        (
            limits.displacement_rate * interval,
            limits.displacement_min,
            limits.displacement_max,
            min(max(options.pretension, limits.tension_min), limits.tension_max),
            limits.tension_max,
            limits.tension_rate * interval,
        ),
        target.tip_position,
        float(target.tip_position_weight),
        target.direction_or_zeros,
        float(target.tip_direction_weight),
        target.backbone_station,
        target.backbone_position,
        target.backbone_weight,
        np.asarray(backbone_station, dtype=float),
        1.0 - math.sqrt(options.axial_weight),
        options.energy_weight,
        damping * options.proximal_weight,
    )


@njit(cache=True)
def tip_axis(effector: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Unit vector (3,) that splits the tip's error into axial and lateral: the target's direction (3,), where that is zeros the
    effector's (e,).
    """
    return direction if (direction * direction).sum() > 0.0 else _unit(effector[3:6])


@njit(cache=True)
def _built(
    change, free, compliance_aa, displacement_free, tension, displacement, limits, tip, tip_weight, direction, direction_weight,
    stations, points, weights, backbone_station, less, energy, proximal,
):  # fmt: skip
    """As `build_programme`; limits: the last six arguments of `step_bounds`; `less` as for `_weighted_errors`."""
    jacobian, offset = _weighted_errors(
        change, free, tension, tip, tip_weight, direction, direction_weight, stations, points, weights, backbone_station, less
    )
    hessian, gradient, compliance = _quadratic(jacobian, offset, compliance_aa, tension, energy, proximal)
    bounds = step_bounds(displacement, tension, compliance_aa @ tension + displacement_free, *limits)
    return scaled(Programme(hessian, gradient, compliance, displacement_free, bounds))


@njit(cache=True)
def _weighted_errors(
    change, free, tension, tip, tip_weight, direction, direction_weight, stations, points, weights, backbone_station, less
):
    """M W_ea (k, m) and M (e_free - e_target) (k,) for the rows of the parts of the target that have a weight; along the robot is
    where it lies under the present tensions (m,). `less` is 1 - sqrt(a): the root of I - (1 - a) t t^T is I - (1 - sqrt(a)) t t^T.
    """
    m = len(tension)
    effector = change @ tension + free
    count = int(tip_weight > 0.0) + int(direction_weight > 0.0) + int((weights > 0.0).sum())
    jacobian, offset = np.empty((3 * count, m)), np.empty(3 * count)
    row = 0
    if tip_weight > 0.0:
        axis = tip_axis(effector, direction)
        jacobian[:3], offset[:3] = change[:3], free[:3] - tip
        # Along the target's direction means along the robot only where it points there: far from it, that is the way to go.
        aligned = max(0.0, (axis * _unit(effector[3:6])).sum())
        _weigh(jacobian[:3], offset[:3], axis, less * aligned * aligned, tip_weight)
        row = 3
    if direction_weight > 0.0:
        jacobian[row : row + 3], offset[row : row + 3] = change[3:6], free[3:6] - direction
        _weigh(jacobian[row : row + 3], offset[row : row + 3], direction, 0.0, direction_weight)
        row += 3
    for index in range(len(stations)):
        if weights[index] <= 0.0:
            continue
        left = min(max(np.searchsorted(backbone_station, stations[index]) - 1, 0), len(backbone_station) - 2)
        share = (stations[index] - backbone_station[left]) / (backbone_station[left + 1] - backbone_station[left])
        a, b = 6 + 3 * left, 9 + 3 * left
        jacobian[row : row + 3] = (1.0 - share) * change[a : a + 3] + share * change[b : b + 3]
        offset[row : row + 3] = (1.0 - share) * free[a : a + 3] + share * free[b : b + 3] - points[index]
        along = _unit(effector[b : b + 3] - effector[a : a + 3])
        _weigh(jacobian[row : row + 3], offset[row : row + 3], along, less, weights[index])
        row += 3
    return jacobian, offset


@njit(cache=True)
def _weigh(block, error, axis, less, weight):
    """Take `less` of the part along the axis (3,) from block (3, m) and error (3,), then multiply by the root of the weight."""
    root = np.sqrt(weight)
    along = less * (axis[0] * error[0] + axis[1] * error[1] + axis[2] * error[2])
    for i in range(3):
        error[i] = root * (error[i] - along * axis[i])
    for k in range(block.shape[1]):
        along = less * (axis[0] * block[0, k] + axis[1] * block[1, k] + axis[2] * block[2, k])
        for i in range(3):
            block[i, k] = root * (block[i, k] - along * axis[i])


@njit(cache=True)
def _quadratic(jacobian, offset, compliance_aa, tension, energy, proximal):
    """Hessian, gradient and symmetric compliance of the programme; `energy` and `proximal` are relative to the errors' part."""
    compliance = 0.5 * (compliance_aa + compliance_aa.T)
    hessian = 2.0 * (jacobian.T @ jacobian)
    scale = np.trace(hessian) / np.trace(compliance)
    hessian += (scale * energy) * compliance
    gradient = 2.0 * (jacobian.T @ offset)
    for i in range(len(tension)):
        hold = scale * proximal * compliance[i, i]
        hessian[i, i] += hold
        gradient[i] -= hold * tension[i]
    return hessian, gradient, compliance


@njit(cache=True)
def _unit(vector):
    return vector / np.sqrt((vector * vector).sum())
