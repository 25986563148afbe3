"""The inverse problem of one step as a quadratic programme (QP) in the cables' tensions; `solver` solves it.

The linear response of the model at its present state gives the effector e = W_ea lambda + e_free and the path displacement
delta = W_aa lambda + delta_free. The tensions lambda that bring the effector nearest to its target solve (after Coevoet,
Escande and Duriez, IEEE RA-L 2017)

    min   |M (W_ea lambda + e_free - e_target)|^2  +  c (eps lambda^T W_aa lambda  +  rho |lambda - lambda_now|_D^2)
    s.t.  tension_lower <= lambda <= tension_upper,
          displacement_lower <= W_aa lambda + delta_free <= displacement_upper,
          n . (W_aa lambda + delta_free - s) >= 0 for antagonists on one motor, = 0 for cables that one motor pulls together,
          what is around the robot (`surroundings`),

where n and s are those of `description.transmission`, M contains the roots of the weights, D is the diagonal of W_aa, and c =
trace(W_ea^T M^T M W_ea) / trace(W_aa) makes eps and rho independent of the robot's size. The energy term eps selects, among
tensions of equal effect, those without cables that work against each other. The proximal term rho makes the sequence of steps, a
Gauss-Newton iteration, settle (see `damping`).
The part of the errors of tip and backbone along the robot counts less, because cables can only pull: they cannot undo their
shortening. At the tip this is the part along the target's direction; the reduction of its weight fades as the tip points away
from that direction.

The tip's direction counts as far as cables can turn it without moving the tip across. With W the diagonal of W_aa, both
responses are those to the tensions of equal work, J = W_ea W^(-1/2); N projects on the tensions that leave the tip's lateral
position and the length of the backbone, and

    D = G (G + delta g I)^-1,   G = J_direction N J_direction^T,   g: largest eigenvalue of J_direction J_direction^T

multiplies the rows of the direction. It is about 1 where segments move the tip and turn it each by themselves, and about 0 where
the same cables do both: there a weight of the direction would only pull the tip off its place. Tensions that only shorten the
robot do not count: a soft robot near its buckling load turns by them, and all its cables would pull it together.
"""

import math
from typing import TYPE_CHECKING

import numpy as np
from numba import njit

from gravcomp.description import Limits
from gravcomp.inverse.limits import step_bounds
from gravcomp.inverse.options import InverseOptions
from gravcomp.inverse.release import ReleaseErrors
from gravcomp.inverse.scaling import NO_ROWS, UNCOUPLED, Couplings, Programme, ScaledProgramme, TensionRows, scaled
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
    least_tension: np.ndarray | None = None,
    couplings: Couplings = UNCOUPLED,
    around: TensionRows = NO_ROWS,
    release: ReleaseErrors | None = None,
) -> ScaledProgramme:
    """Return the programme at the present state, for the next `interval` s.

    tension (m,): present tensions in N, reference of the proximal term; displacement (m,): last command in m; backbone_station
    (n,): stations of the effector's backbone rows; damping: factor of the proximal term; least_tension (m,) in N: lower bound of
    each cable's tension, that of options and limits when not given; couplings: of cables that share motors;
    around: of `surroundings`; release: of `release.Release`, default none.
    """
    if least_tension is None:
        least_tension = np.full(len(tension), max(options.pretension, limits.tension_min))
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
            np.minimum(least_tension, limits.tension_max),
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
        couplings,
        around,
        ReleaseErrors.none(len(tension)) if release is None else release,
    )


# delta of the module's text: cables that turn the tip in place by less than a thirtieth of what they turn it do not count.
_SEPARATE = 1e-3
# Of the square of the tip's motion. Cables that shorten a slender robot do so by more; what bending changes of the length,
# measured from point to point, is less.
_LEAST_SHORTENING = 1e-5


@njit(cache=True)
def tip_axis(effector: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Return the unit vector (3,) that splits the tip's error into axial and lateral error.

    It is the target's direction (3,), or, if that is zeros, the direction of the tip in the effector (e,).
    """
    return direction if (direction * direction).sum() > 0.0 else _unit(effector[3:6])


@njit(cache=True)
def _built(
    change: np.ndarray, free: np.ndarray, compliance_aa: np.ndarray, displacement_free: np.ndarray, tension: np.ndarray,
    displacement: np.ndarray, limits: tuple, tip: np.ndarray, tip_weight: float, direction: np.ndarray, direction_weight: float,
    stations: np.ndarray, points: np.ndarray, weights: np.ndarray, backbone_station: np.ndarray, less: float, energy: float,
    proximal: float, couplings: Couplings, around: TensionRows, release: ReleaseErrors,
) -> ScaledProgramme:  # fmt: skip
    """Compiled `build_programme`; limits: the last six arguments of `step_bounds`; `less` as in `_weighted_errors`."""
    jacobian, offset = _weighted_errors(
        change, free, compliance_aa, tension, tip, tip_weight, direction, direction_weight, stations, points, weights,
        backbone_station, less,
    )  # fmt: skip
    if len(release.offset):
        root = np.sqrt(tip_weight)
        jacobian, offset = np.vstack((jacobian, root * release.change)), np.concatenate((offset, root * release.offset))
    hessian, gradient, compliance = _quadratic(jacobian, offset, compliance_aa, tension, energy, proximal)
    bounds = step_bounds(displacement, tension, compliance_aa @ tension + displacement_free, *limits)
    return scaled(Programme(hessian, gradient, compliance, displacement_free, bounds, couplings, around))


@njit(cache=True)
def _weighted_errors(
    change: np.ndarray, free: np.ndarray, compliance_aa: np.ndarray, tension: np.ndarray, tip: np.ndarray, tip_weight: float,
    direction: np.ndarray, direction_weight: float, stations: np.ndarray, points: np.ndarray, weights: np.ndarray,
    backbone_station: np.ndarray, less: float,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Return M W_ea (k, m) and M (e_free - e_target) (k,) for the weighted parts of the target.

    The axis t of the robot is that of the shape under the present tensions (m,). less = 1 - sqrt(a) for the relative weight a
    along t: the root of I - (1 - a) t t^T is I - (1 - sqrt(a)) t t^T.
    """
    m = len(tension)
    effector = change @ tension + free
    count = int(tip_weight > 0.0) + int(direction_weight > 0.0) + int((weights > 0.0).sum())
    jacobian, offset = np.empty((3 * count, m)), np.empty(3 * count)
    row = 0
    if tip_weight > 0.0:
        axis = tip_axis(effector, direction)
        jacobian[:3], offset[:3] = change[:3], free[:3] - tip
        # The target's direction is the axis of the robot only near the target; far from it, the tip has to move along this
        # direction.
        aligned = max(0.0, (axis * _unit(effector[3:6])).sum())
        _weigh(jacobian[:3], offset[:3], axis, less * aligned * aligned, tip_weight)
        row = 3
    if direction_weight > 0.0:
        jacobian[row : row + 3], offset[row : row + 3] = change[3:6], free[3:6] - direction
        if tip_weight > 0.0:
            apart = _turned_in_place(change, effector, compliance_aa, direction)
            jacobian[row : row + 3], offset[row : row + 3] = apart @ change[3:6], apart @ offset[row : row + 3]
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
def _turned_in_place(change: np.ndarray, effector: np.ndarray, compliance_aa: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """Return D (3, 3) of the module's text for the effector's response `change` (e, m) at the shape `effector` (e,).

    axis (3,): the target's direction.
    """
    m = change.shape[1]
    moved_by, turn = np.empty((3, m)), np.empty((3, m))
    longer = _lengthening(change, effector)
    for k in range(m):
        root = 1.0 / np.sqrt(compliance_aa[k, k])
        along = axis[0] * change[0, k] + axis[1] * change[1, k] + axis[2] * change[2, k] - longer[k]
        for i in range(3):
            moved_by[i, k], turn[i, k] = root * (change[i, k] - along * axis[i]), root * change[3 + i, k]
    moved = moved_by @ moved_by.T
    size = np.trace(moved)
    if size <= 0.0:
        return np.eye(3)
    for i in range(3):
        for j in range(3):
            moved[i, j] += _LEAST_SHORTENING * size * axis[i] * axis[j]
        moved[i, i] += 1e-12 * size
    both = turn @ moved_by.T
    whole = turn @ turn.T
    alone = whole - both @ np.linalg.solve(moved, both.T)
    largest = np.linalg.eigvalsh(whole)[2]
    if largest <= 0.0:
        return np.zeros((3, 3))
    return alone @ np.linalg.inv(alone + _SEPARATE * largest * np.eye(3))


@njit(cache=True)
def _lengthening(change: np.ndarray, effector: np.ndarray) -> np.ndarray:
    """Return the response (m,) of the backbone's length, from point to point; change (e, m), effector (e,)."""
    longer = np.zeros(change.shape[1])
    for a in range(6, len(effector) - 5, 3):
        along = _unit(effector[a + 3 : a + 6] - effector[a : a + 3])
        for k in range(change.shape[1]):
            for i in range(3):
                longer[k] += along[i] * (change[a + 3 + i, k] - change[a + i, k])
    return longer


@njit(cache=True)
def _weigh(block: np.ndarray, error: np.ndarray, axis: np.ndarray, less: float, weight: float) -> None:
    """Subtract `less` times the part along the axis (3,) from block (3, m) and error (3,); multiply by the root of the weight."""
    root = np.sqrt(weight)
    along = less * (axis[0] * error[0] + axis[1] * error[1] + axis[2] * error[2])
    for i in range(3):
        error[i] = root * (error[i] - along * axis[i])
    for k in range(block.shape[1]):
        along = less * (axis[0] * block[0, k] + axis[1] * block[1, k] + axis[2] * block[2, k])
        for i in range(3):
            block[i, k] = root * (block[i, k] - along * axis[i])


@njit(cache=True)
def _quadratic(
    jacobian: np.ndarray, offset: np.ndarray, compliance_aa: np.ndarray, tension: np.ndarray, energy: float, proximal: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return Hessian, gradient and symmetric compliance of the programme; energy and proximal: eps and rho."""
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
def _unit(vector: np.ndarray) -> np.ndarray:
    return vector / np.sqrt((vector * vector).sum())
