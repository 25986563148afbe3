"""Least-squares fit of a robot's parameters to resting tips.

    min over x of  sum_k w_k (|(p_k(x) - measured_k) / sigma_p|^2 + |(d_k(x) - measured_k) / sigma_d|^2) + |R x|^2 + others

over positions p and, where they are measured, directions d of the tip. R is the prior (`unknowns.Priors`); w_k is the share of a
window in its rest; the others hold the robot's mass to that of a balance, if one is given, and the bias of the accelerometer to
the length of the specific force (`force_length`), if the IMU gave it. The deviations sigma_p and sigma_d
begin at declared values; a second round takes them from the residuals of the first. What the data do not determine is not fitted,
and says why (`estimates.unfit`); it keeps the described value. Creep that is not described begins at what is usual for the class
of the material, and stays there where the data do not show it: every polymer creeps, and without it the moduli would stand for
it.

Intervals are at 95 %: cov = (J^T J + R^T R)^-1, with J scaled by those sigmas and with every unknown, those that are not fitted
as well: what is not known of them widens the intervals of the others. Those of moduli contain in addition what the model lacks
(`TipNoise.stiffness`), and those of creep, with all that is correlated with it, what no branch follows (`TipNoise.creep`).
Friction inside the material is fitted, because moduli and creep would stand for it, but not told (`estimates.UNTOLD`).
Gravity bends the robot by density over modulus, so tips alone cannot tell both: without a balance the density keeps its value,
and its uncertainty is part of the moduli's intervals.
"""

import functools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gravcomp.calibration.estimates import Estimate, estimate, fitted_together, moduli_told, name_of, partners_of, unfit, warnings
from gravcomp.calibration.force_length import implausible_length, length_rows
from gravcomp.calibration.measured import MeasurementError, StillWindows, rms_distance
from gravcomp.calibration.noise_limit import limited, sag_of
from gravcomp.calibration.parameters import StaticParameters, starting_parameters
from gravcomp.calibration.plausible import check_explained, check_frame
from gravcomp.calibration.problem import Predictor, Problem
from gravcomp.calibration.statics import StaticPrediction, StaticPredictor
from gravcomp.calibration.unknowns import Priors, Unknown, parameters_at, prior_rows, unknowns_of
from gravcomp.confidence import half_width
from gravcomp.config import parameter
from gravcomp.description import Robot
from gravcomp.full_model.robot_model import RobotModel
from gravcomp.materials.material_classes import class_of
from gravcomp.mesh.coarse import with_coarse_elements

_AT_BOUND = 0.01  # of a logarithm


@dataclass(frozen=True)
class TipNoise:
    """Deviations of a resting tip from the model at the start of the fit, camera and model together."""

    position_share: float = parameter(2e-3, minimum=1e-6, maximum=0.1, description="position, over the robot's length")
    direction: float = parameter(0.5, edge="deg", minimum=1e-4, maximum=45.0, description="direction")
    smallest: float = parameter(0.1, minimum=1e-6, maximum=1.0, description="least share of these that the residuals may show")
    bending: float = parameter(5.0, minimum=1.0, maximum=1e3, description="bending by gravity that is needed, in deviations")
    stiffness: float = parameter(
        0.008,
        minimum=0.0,
        maximum=0.5,
        description="error of the stiffness that no fit sees, relative: inner friction, the law at small strain",
    )
    creep: float = parameter(
        0.35,
        minimum=0.0,
        maximum=2.0,
        description="error of a branch of creep that no fit sees, relative: bodies creep by other times than the branches",
    )
    slip: float = parameter(
        0.8,
        minimum=0.0,
        maximum=10.0,
        description="error of the friction inside the material that no fit sees, over that of its class",
    )
    balance: float = parameter(5e-3, minimum=1e-6, maximum=0.5, description="deviation of a weighed mass, relative")


@dataclass(frozen=True)
class StaticFit:
    """Result of the fit.

    before and after: predictions with the initial and the fitted parameters; rms_before and rms_after: tip error over the windows
    in m; evaluations: number of predictions for all windows, including `before` and `after`; creep_times: of the branches;
    open_error and sag: what noise leaves open of the tips, and how far gravity moves the released one, in m (`noise_limit`).
    """

    parameters: StaticParameters
    estimates: tuple[Estimate, ...]
    before: StaticPrediction
    after: StaticPrediction
    windows: StillWindows
    rms_before: float
    rms_after: float
    evaluations: int
    warnings: tuple[str, ...]
    creep_times: tuple[float, ...] = ()
    open_error: float = 0.0
    sag: float | None = None

    @property
    def fitted(self) -> set[str]:
        """Kinds of what the data determine."""
        return {e.kind for e in self.estimates if not e.reason}


def fit_statics(
    robot: Robot,
    windows: StillWindows,
    *,
    groups: set[str] | None = None,
    mass: float | None = None,
    creep_times: tuple[float, ...] = (),
    priors: Priors | None = None,
    noise: TipNoise | None = None,
    predictor: Predictor | None = None,
    progress: Callable[[str], None] = lambda sentence: None,
) -> StaticFit:
    """Fit to the windows; groups: of `unknowns.GROUPS`, what is fitted in addition to the moduli, None: all.

    mass: of body and payload in kg, from a balance; creep_times: of the branches of creep in s, for windows with a history.
    predictor: of these windows, the robot's full model where it is not given. Raises MeasurementError if the windows cannot
    determine the moduli, if the described robot has no equilibrium in one of them, and if no values describe them better than the
    robot's description does. Other values at which a window has no equilibrium only shorten the fit's steps.
    """

    priors, noise = priors or Priors(), noise or TipNoise()
    own = predictor is None
    predictor = predictor or StaticPredictor(robot, windows, creep_times)
    initial = starting_parameters(robot, creep_times, usual_creep=groups is None or "creep" in groups)
    try:
        before = predictor.predict(initial)
    except RuntimeError as error:
        raise _no_start(error) from error
    if own:
        exchanged = functools.cache(lambda: StaticPredictor(with_coarse_elements(robot), windows))  # they show in centimetres
        check_frame(robot, windows, before.tip, lambda displacement: exchanged().tips_of(displacement))
    sigma = np.array([noise.position_share * robot.length, noise.direction])
    unknowns = unknowns_of(robot, before, initial, groups, priors)
    problem = Problem(predictor, initial, unknowns, prior_rows(unknowns, priors), sigma, progress)
    if mass is not None:
        problem.weigh(mass, *body_mass(robot), noise.balance)
    problem.add(*length_rows(windows, unknowns, robot.imu_mount.rotation, priors))
    try:
        bends = problem.bending(np.zeros(len(unknowns)))
    except RuntimeError as error:
        raise _no_start(error) from error
    if bends < noise.bending * sigma[0]:
        raise MeasurementError(
            f"twice the modulus would move the tips by {1e3 * bends:.2f} mm at most: gravity hardly bends the robot in these"
            " poses; release it with its axis well away from the vertical"
        )
    fitted = np.ones(len(unknowns), dtype=bool)
    x = problem.solve(np.zeros(len(unknowns)), fitted)
    problem.sigma = problem.residual_sigma(x, noise.smallest * sigma)
    deviation = np.sqrt(np.diag(problem.covariance(x)))
    quantile = half_width(problem.freedom(x))
    names = [name_of(robot, unknown, creep_times) for unknown in unknowns]
    partners = partners_of(problem.information(x), unknowns, priors)
    reasons = [
        unfit(u, entry, half, quantile * half, [names[j] for j in others], float(initial.values(u.kind)[u.index[0]]) / u.scale)
        for u, entry, half, others in zip(unknowns, x, deviation, partners)
    ]
    reasons = fitted_together(unknowns, reasons)
    reasons = moduli_told(unknowns, reasons, problem.covariance(x))
    fitted = np.array([not reason for reason in reasons])
    x = problem.solve(np.where(fitted, x, 0.0), fitted)
    problem.sigma = problem.residual_sigma(x, noise.smallest * sigma)
    covariance = problem.covariance(x)
    after, parameters = problem.predict(x), parameters_at(x, unknowns, initial)
    deviation = np.hypot(np.sqrt(np.diag(covariance)), _unseen(robot, covariance, unknowns, parameters, initial, noise))
    estimates = tuple(
        estimate(robot, unknown, initial, parameters, quantile * half, half, reason, creep_times)
        for unknown, half, reason in zip(unknowns, deviation, reasons)
    )
    for unknown, entry in zip(unknowns, x):
        if unknown.kind == "modulus" and min(entry - unknown.lowest(initial), unknown.highest() - entry) < _AT_BOUND:
            raise MeasurementError(
                "no modulus describes these data: the best one is at the bound of its range. Are they of another robot, in"
                " other units, in another frame than soft_base, or mirrored?"
            )
    rms_before, rms_after = (rms_distance(found.tip[:, :3] - windows.tip_position) for found in (before, after))
    if own:
        check_explained(robot, windows, after.tip)
    if problem.worse(x, np.zeros(len(x))):
        raise MeasurementError(
            f"no values describe these data better than the robot file does (tip error {1e3 * rms_before:.2f} mm before,"
            f" {1e3 * rms_after:.2f} mm after): nothing is written"
        )
    open_error, sag = problem.open_error(x), sag_of(robot, windows, after)
    return StaticFit(
        parameters=parameters,
        estimates=estimates,
        before=before,
        after=after,
        windows=windows,
        rms_before=rms_before,
        rms_after=rms_after,
        evaluations=problem.evaluations,
        warnings=(
            *warnings(robot, unknowns, estimates, bool(np.isfinite(windows.displacement).any())),
            *filter(None, [implausible_length(windows, priors), limited(open_error, sag)]),
        ),
        creep_times=creep_times,
        open_error=open_error,
        sag=sag,
    )


def _no_start(error: RuntimeError) -> MeasurementError:
    """Return the error about a described robot that has no shape in a window."""
    return MeasurementError(
        f"the fit cannot begin, the described robot has no shape: {error}; check gravity and displacements of the data, and"
        " modulus, density and limits of the robot file"
    )


def _unseen(
    robot: Robot,
    covariance: np.ndarray,
    unknowns: list[Unknown],
    parameters: StaticParameters,
    initial: StaticParameters,
    noise: TipNoise,
) -> np.ndarray:
    """Return the deviations (u,) in x that the scatter of the tips does not show.

    What the branches of creep cannot follow goes into all that is correlated with them.
    """
    found = np.array([noise.stiffness if unknown.kind == "modulus" else 0.0 for unknown in unknowns])
    for i, unknown in enumerate(unknowns):
        if unknown.kind == "slip":
            found[i] = noise.slip * class_of(robot.materials[0].youngs_modulus).slip / unknown.scale
        if unknown.kind == "creep":
            of_branch = noise.creep * max(float(values.creep[unknown.index[0]]) for values in (parameters, initial))
            found = np.hypot(found, of_branch / unknown.scale * covariance[:, i] / covariance[i, i])
    return found


def body_mass(robot: Robot) -> tuple[float, float, float]:
    """Return the mass in kg of what the density stands for, of the payload, and of the rest of the robot."""
    model = RobotModel(with_coarse_elements(robot))
    body, payload = float(model.body_weight.sum()), robot.payload.mass
    return body, payload, model.mass - body - payload
