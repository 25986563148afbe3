"""Least-squares fit of moduli, cable offsets, cable compliance and winding ratio to resting tips.

    min over x of  sum_k |(p_k(x) - measured_k) / sigma_p|^2 + |(d_k(x) - measured_k) / sigma_d|^2 + |R x|^2

over positions p and, where they are measured, directions d of the tip. R is the prior (`unknowns.Priors`). The deviations
sigma_p and sigma_d begin at declared values; a second round takes them from the residuals of the first. What the data do not
determine is not fitted, and says why (`estimates.unfit`).

Intervals are at 95 %: cov = (J^T J + R^T R)^-1, with J scaled by those sigmas and with every unknown, those that are not fitted
as well: what is not known of them widens the intervals of the others. The density is taken as given: gravity bends the robot by
density over modulus, so the data cannot determine both.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from gravcomp.calibration.estimates import Estimate, estimate, unfit, warnings
from gravcomp.calibration.measured import MeasurementError, StillWindows, rms_distance
from gravcomp.calibration.statics import StaticParameters, StaticPrediction, StaticPredictor
from gravcomp.calibration.unknowns import Priors, Unknown, parameters_at, prior_rows, unknowns_of
from gravcomp.config import parameter
from gravcomp.description import Robot

_AT_BOUND = 0.01  # of a logarithm


@dataclass(frozen=True)
class TipNoise:
    """Deviations of a resting tip from the model at the start of the fit, camera and model together."""

    position_share: float = parameter(2e-3, minimum=1e-6, maximum=0.1, description="position, over the robot's length")
    direction: float = parameter(1e-2, edge="deg", minimum=1e-5, maximum=1.0, description="direction")
    smallest: float = parameter(0.02, minimum=1e-6, maximum=1.0, description="least share of these that the residuals may show")
    bending: float = parameter(5.0, minimum=1.0, maximum=1e3, description="bending by gravity that is needed, in deviations")


class Predictor(Protocol):
    """What predicts the tips of the windows."""

    windows: StillWindows

    def predict(self, parameters: StaticParameters) -> StaticPrediction:
        """Return the prediction. Raises RuntimeError if there is no equilibrium."""


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
    priors: Priors | None = None,
    noise: TipNoise | None = None,
    predictor: Predictor | None = None,
    progress: Callable[[str], None] = lambda sentence: None,
) -> StaticFit:
    """Fit to the windows; offsets, compliance and winding select what is fitted in addition to the moduli.

    predictor: of these windows, the robot's full model where it is not given. Raises MeasurementError if the windows cannot
    determine the moduli, and if no values describe them better than the robot's description does.
    """
    from scipy.stats import t as student

    priors, noise = priors or Priors(), noise or TipNoise()
    predictor = predictor or StaticPredictor(robot, windows)
    moduli = np.array([material.youngs_modulus for material in robot.materials])
    initial = StaticParameters(moduli, np.zeros(len(robot.cables)), cable_compliance(robot))
    before = predictor.predict(initial)
    sigma = np.array([noise.position_share * robot.length, noise.direction])
    bends = np.linalg.norm(before.by_modulus[:, :3].sum(axis=2), axis=1).max()
    if bends < noise.bending * sigma[0]:
        raise MeasurementError(
            f"twice the modulus would move the tips by {1e3 * bends:.2f} mm at most: gravity hardly bends the robot in these"
            " poses; release it with its axis well away from the vertical"
        )
    unknowns = unknowns_of(robot, before, offsets, compliance, winding, priors)
    problem = _Problem(predictor, initial, unknowns, prior_rows(unknowns, priors), sigma, progress)
    fitted = np.ones(len(unknowns), dtype=bool)
    x = problem.solve(np.zeros(len(unknowns)), fitted)
    problem.sigma = problem.residual_sigma(x, noise.smallest * sigma)
    deviation = np.sqrt(np.diag(problem.covariance(x)))
    quantile = float(student.ppf(0.975, problem.freedom))
    reasons = [unfit(u, entry, own, quantile * own) for u, entry, own in zip(unknowns, x, deviation)]
    fitted = np.array([not reason for reason in reasons])
    x = problem.solve(np.where(fitted, x, 0.0), fitted)
    problem.sigma = problem.residual_sigma(x, noise.smallest * sigma)
    covariance = problem.covariance(x)
    deviation = np.sqrt(np.diag(covariance))
    after, parameters = problem.predict(x), parameters_at(x, unknowns, initial)
    estimates = tuple(
        estimate(robot, unknown, initial, parameters, quantile * own, own, reason)
        for unknown, own, reason in zip(unknowns, deviation, reasons)
    )
    for unknown, entry in zip(unknowns, x):
        if unknown.kind == "modulus" and min(entry - unknown.lowest(initial), unknown.highest() - entry) < _AT_BOUND:
            raise MeasurementError(
                "no modulus describes these data: the best one is at the bound of its range. Are they of another robot, in"
                " other units, in another frame than soft_base, or mirrored?"
            )
    rms_before, rms_after = (rms_distance(found.tip[:, :3] - windows.tip_position) for found in (before, after))
    if problem.misfit(x) > problem.misfit(np.zeros(len(x))):
        raise MeasurementError(
            f"no values describe these data better than the robot file does (tip error {1e3 * rms_before:.2f} mm before,"
            f" {1e3 * rms_after:.2f} mm after): nothing is written"
        )
    return StaticFit(
        parameters=parameters,
        estimates=estimates,
        before=before,
        after=after,
        windows=windows,
        rms_before=rms_before,
        rms_after=rms_after,
        evaluations=problem.evaluations,
        warnings=tuple(warnings(robot, windows, unknowns, estimates, covariance)),
    )


def cable_compliance(robot: Robot) -> np.ndarray:
    """Return (m,) the elongation in m/N of each cable from capstan to end, from the robot's description."""
    return np.array([robot.cable_compliance(cable) for cable in robot.cables])


class _Problem:
    """Residuals and Jacobian of the fit as functions of x. Keeps predictions; evaluations: number of them.

    sigma (2,): deviations of position in m and of direction; prior (u, u): rows of its residuals.
    """

    def __init__(
        self,
        predictor: Predictor,
        initial: StaticParameters,
        unknowns: list[Unknown],
        prior: np.ndarray,
        sigma: np.ndarray,
        progress: Callable[[str], None],
    ):
        self.sigma, self.evaluations = sigma, 0
        self._predictor, self._initial, self._unknowns, self._prior = predictor, initial, unknowns, prior
        self._progress = progress
        windows = predictor.windows
        self._directed = windows.tip_direction is not None
        parts = [windows.tip_position] if windows.tip_direction is None else [windows.tip_position, windows.tip_direction]
        self._measured = np.hstack(parts)
        self._known: dict[bytes, StaticPrediction] = {}

    @property
    def freedom(self) -> int:
        """Degrees of freedom of the residuals: a direction has two."""
        return max(1, len(self._measured) * (5 if self._directed else 3) - len(self._unknowns))

    def predict(self, x: np.ndarray) -> StaticPrediction:
        """Return the prediction at x."""
        key = x.tobytes()
        if key not in self._known:
            self.evaluations += 1
            self._known[key] = self._predictor.predict(parameters_at(x, self._unknowns, self._initial))
            error = rms_distance(self._known[key].tip[:, :3] - self._measured[:, :3])
            self._progress(f"evaluation {self.evaluations}: {1e3 * error:.3f} mm RMS")
        return self._known[key]

    def solve(self, start: np.ndarray, fitted: np.ndarray) -> np.ndarray:
        """Return the minimum over the entries `fitted` (u,) bool of x; the others keep those of `start`."""
        from scipy.optimize import least_squares

        low = np.array([unknown.lowest(self._initial) for unknown in self._unknowns])[fitted]
        high = np.array([unknown.highest() for unknown in self._unknowns])[fitted]

        def whole(part: np.ndarray) -> np.ndarray:
            x = start.copy()
            x[fitted] = part
            return x

        # A start on a bound would shorten the solver's first steps.
        solution = least_squares(
            lambda part: self.residuals(whole(part)),
            np.clip(start[fitted], low + 0.2, high - 0.2),
            jac=lambda part: self.jacobian(whole(part))[:, fitted],
            bounds=(low, high),
            x_scale="jac",
            xtol=1e-4,
            ftol=1e-4,
            max_nfev=20,
        )
        return whole(solution.x)

    def errors(self, x: np.ndarray) -> np.ndarray:
        """Return modelled minus measured tips (k, 3 or 6), position in m and direction."""
        return self.predict(x).tip[:, : self._measured.shape[1]] - self._measured

    def residual_sigma(self, x: np.ndarray, smallest: np.ndarray) -> np.ndarray:
        """Return the deviations (2,) that the residuals at x show, at least `smallest` (2,)."""
        error, shares = self.errors(x), np.array([3.0, 2.0 if self._directed else 0.0]) * len(self._measured)
        # Position and direction use up the unknowns in proportion to their numbers.
        used = shares * (1.0 - min(len(self._unknowns) / shares.sum(), 0.9))
        found = [np.sqrt((part**2).sum() / max(count, 1.0)) for part, count in zip((error[:, :3], error[:, 3:]), used)]
        return np.maximum(found, smallest)

    def misfit(self, x: np.ndarray) -> float:
        """Return the sum of the squared residuals of the data at x."""
        return float((self._scaled(self.errors(x)) ** 2).sum())

    def covariance(self, x: np.ndarray) -> np.ndarray:
        """Return the covariance (u, u) of x, with every unknown free."""
        rows = self.jacobian(x)
        return np.linalg.pinv(rows.T @ rows)

    def residuals(self, x: np.ndarray) -> np.ndarray:
        """Return the scaled tip errors and those of the prior."""
        return np.concatenate([self._scaled(self.errors(x)).ravel(), self._prior @ x])

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """Return the derivative of the residuals by x."""
        prediction, width = self.predict(x), self._measured.shape[1]
        columns = [self._scaled(unknown.derivative(prediction)[:, :width]).ravel() for unknown in self._unknowns]
        return np.concatenate([np.column_stack(columns), self._prior])

    def _scaled(self, rows: np.ndarray) -> np.ndarray:
        """Return rows (k, 3 or 6) of positions and directions over their deviations."""
        return rows / np.repeat(self.sigma, 3)[: rows.shape[1]]
