"""Least-squares fit of modulus, cable offsets, cable compliance and winding ratio to resting tips.

    min over x of  sum_k |tip_k(x) - measured_k|^2 / sigma^2 + sum_i (x_i - mean_i)^2 / prior_i^2

Offsets, compliances and the winding ratio have priors (0 +- 1 mm; the described compliance +- 0.5 mm/N; 1 +- 2 %), so a cable
that is never taut keeps its values. Intervals are at 95 %, from the Jacobian at the solution: cov = s^2 (J^T J)^-1 with the
variance s^2 of the residuals. The density is taken as given: gravity bends the robot by density over modulus, so the data
cannot determine both.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gravcomp.calibration.estimates import Estimate, estimate, warnings
from gravcomp.calibration.measured import MeasurementError, StillWindows
from gravcomp.calibration.statics import StaticParameters, StaticPrediction, StaticPredictor
from gravcomp.calibration.unknowns import Unknown, parameters_at, unknowns_of
from gravcomp.description import Robot

TIP_NOISE = 0.2e-3  # m: noise of a measured tip, averaged over a window; scale of the residuals


@dataclass(frozen=True)
class StaticFit:
    """Result of the fit.

    before and after: predictions with the initial and the fitted parameters; rms_before and rms_after: tip error over the
    windows in m; evaluations: number of predictions for all windows, including `before` and `after`.
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


def fit_statics(
    robot: Robot,
    windows: StillWindows,
    *,
    offsets: bool = True,
    compliance: bool = True,
    winding: bool = True,
    progress: Callable[[str], None] = lambda sentence: None,
) -> StaticFit:
    """Fit to the windows; offsets, compliance and winding select what is fitted in addition to the modulus.

    Raises MeasurementError if the windows cannot determine the modulus.
    """
    from scipy.optimize import least_squares
    from scipy.stats import t as student

    predictor = StaticPredictor(robot, windows)
    initial = StaticParameters(robot.materials[0].youngs_modulus, np.zeros(len(robot.cables)), cable_compliance(robot))
    before = predictor.predict(initial)
    bends = np.linalg.norm(before.by_modulus, axis=1).max() * initial.youngs_modulus
    if bends < 5 * TIP_NOISE:
        raise MeasurementError(
            f"twice the modulus would move the tips by {1e3 * bends:.2f} mm at most: gravity hardly bends the robot in these"
            " poses; release it with its axis well away from the vertical"
        )
    unknowns = unknowns_of(robot, before, offsets, compliance, winding)
    problem = _Problem(predictor, initial, unknowns, progress)
    low = np.array([unknown.lowest(initial) for unknown in unknowns])
    high = np.array([unknown.highest() for unknown in unknowns])
    # A start on a bound would shorten the solver's first steps.
    start = np.maximum(np.zeros(len(unknowns)), low + 0.2)
    solution = least_squares(
        problem.residuals, start, jac=problem.jacobian, bounds=(low, high), x_scale="jac", xtol=1e-4, ftol=1e-4, max_nfev=20
    )
    after, parameters = problem.predict(solution.x), parameters_at(solution.x, unknowns, initial)

    misfit = (after.tip - windows.tip_position).ravel() / TIP_NOISE
    freedom = max(1, misfit.size - len(unknowns))
    variance = max(float(misfit @ misfit) / freedom, 1e-6)
    data_rows = problem.jacobian(solution.x)[: misfit.size]
    precision = data_rows.T @ data_rows / variance + np.diag([0.0] + [1.0] * (len(unknowns) - 1))
    covariance = np.linalg.pinv(precision)
    deviation = np.sqrt(np.diag(covariance))
    quantile = float(student.ppf(0.975, freedom))
    estimates = tuple(
        estimate(robot, unknown, initial, parameters, quantile * sigma, sigma) for unknown, sigma in zip(unknowns, deviation)
    )
    return StaticFit(
        parameters=parameters,
        estimates=estimates,
        before=before,
        after=after,
        windows=windows,
        rms_before=_rms(before.tip - windows.tip_position),
        rms_after=_rms(after.tip - windows.tip_position),
        evaluations=problem.evaluations + 1,
        warnings=tuple(warnings(robot, windows, unknowns, estimates, covariance)),
    )


def cable_compliance(robot: Robot) -> np.ndarray:
    """Return (m,) the elongation in m/N of each cable from capstan to end, from the robot's description."""
    return np.array([robot.cable_compliance(cable) for cable in robot.cables])


class _Problem:
    """Residuals and Jacobian of the fit as functions of x. Keeps the last prediction; evaluations: number of predictions."""

    def __init__(
        self,
        predictor: StaticPredictor,
        initial: StaticParameters,
        unknowns: list[Unknown],
        progress: Callable[[str], None],
    ):
        self.evaluations = 0
        self._predictor, self._initial, self._unknowns, self._progress = predictor, initial, unknowns, progress
        self._measured = predictor.windows.tip_position
        self._last: tuple[bytes, StaticPrediction] | None = None

    def predict(self, x: np.ndarray) -> StaticPrediction:
        """Return the prediction at x."""
        key = x.tobytes()
        if self._last is None or self._last[0] != key:
            self.evaluations += 1
            self._last = key, self._predictor.predict(parameters_at(x, self._unknowns, self._initial))
            error = _rms(self._last[1].tip - self._measured)
            self._progress(f"evaluation {self.evaluations}: {1e3 * error:.3f} mm RMS")
        return self._last[1]

    def residuals(self, x: np.ndarray) -> np.ndarray:
        """Return the scaled tip errors and the deviations from the priors."""
        return np.concatenate([((self.predict(x).tip - self._measured) / TIP_NOISE).ravel(), x[1:]])

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """Return the derivative of the residuals by x."""
        prediction, modulus = self.predict(x), parameters_at(x, self._unknowns, self._initial).youngs_modulus
        columns = [(unknown.derivative(prediction, modulus) / TIP_NOISE).ravel() for unknown in self._unknowns]
        return np.concatenate([np.column_stack(columns), np.eye(len(x))[1:]])


def _rms(error: np.ndarray) -> float:
    """Return the root mean square length of errors (k, 3)."""
    return float(np.sqrt((error**2).sum(axis=1).mean()))
