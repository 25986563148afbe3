"""Least-squares fit of a robot's parameters to resting tips.

    min over x of  sum_k w_k (|(p_k(x) - measured_k) / sigma_p|^2 + |(d_k(x) - measured_k) / sigma_d|^2) + |R x|^2 + weighed

over positions p and, where they are measured, directions d of the tip. R is the prior (`unknowns.Priors`); w_k is the share of a
window in its rest; `weighed` holds the robot's mass to that of a balance, if one is given. The deviations sigma_p and sigma_d
begin at declared values; a second round takes them from the residuals of the first. What the data do not determine is not fitted,
and says why (`estimates.unfit`).

Intervals are at 95 %: cov = (J^T J + R^T R)^-1, with J scaled by those sigmas and with every unknown, those that are not fitted
as well: what is not known of them widens the intervals of the others. Those of the moduli contain in addition what the model
lacks (`TipNoise.stiffness`). Gravity bends the robot by density over modulus, so tips alone cannot tell both: without a balance
the density keeps its value, and its uncertainty is part of the moduli's intervals.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from gravcomp.calibration.estimates import Estimate, estimate, name_of, partners_of, unfit, warnings
from gravcomp.calibration.measured import MeasurementError, StillWindows, rms_distance
from gravcomp.calibration.parameters import StaticParameters
from gravcomp.calibration.plausible import check_explained, check_frame
from gravcomp.calibration.statics import StaticPrediction, StaticPredictor
from gravcomp.calibration.unknowns import Priors, Unknown, parameters_at, prior_rows, unknowns_of
from gravcomp.config import parameter
from gravcomp.description import Robot
from gravcomp.full_model.robot_model import RobotModel
from gravcomp.mesh.tube import with_coarse_elements

_AT_BOUND = 0.01  # of a logarithm
_MOST_STEPS, _SETTLED = 8, 3e-3  # of the search, and the relative gain with which it ends
_PARTS = (1.0, 0.5, 0.2)  # of a step
_ROOM = 1e-9  # of the bounds of a step, which must not be empty
_NEAR = 0.02  # in the moduli's logarithms, over which derivatives hardly change


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
    balance: float = parameter(5e-3, minimum=1e-6, maximum=0.5, description="deviation of a weighed mass, relative")


class Predictor(Protocol):
    """What predicts the tips of the windows."""

    windows: StillWindows

    def predict(self, parameters: StaticParameters) -> StaticPrediction:
        """Return the prediction. Raises RuntimeError if there is no equilibrium."""

    def differentiate(self, parameters: StaticParameters, kinds: set[str]) -> dict[str, np.ndarray]:
        """Return the derivatives (k, 6, n) of the tips by each of the kinds, at least."""


@dataclass(frozen=True)
class StaticFit:
    """Result of the fit.

    before and after: predictions with the initial and the fitted parameters; rms_before and rms_after: tip error over the windows
    in m; evaluations: number of predictions for all windows, including `before` and `after`; creep_times: of the branches.
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
    determine the moduli, and if no values describe them better than the robot's description does.
    """
    from scipy.stats import t as student

    priors, noise = priors or Priors(), noise or TipNoise()
    own = predictor is None
    predictor = predictor or StaticPredictor(robot, windows, creep_times)
    initial = starting_parameters(robot, creep_times)
    before = predictor.predict(initial)
    if own:
        coarse = with_coarse_elements(robot)  # exchanges show in centimetres
        check_frame(robot, windows, before.tip, lambda other: StaticPredictor(coarse, other).predict(initial).tip)
    sigma = np.array([noise.position_share * robot.length, noise.direction])
    unknowns = unknowns_of(robot, before, initial, groups, priors)
    problem = _Problem(predictor, initial, unknowns, prior_rows(unknowns, priors), sigma, progress)
    if mass is not None:
        problem.weigh(mass, *body_mass(robot), noise.balance)
    bends = problem.bending(np.zeros(len(unknowns)))
    if bends < noise.bending * sigma[0]:
        raise MeasurementError(
            f"twice the modulus would move the tips by {1e3 * bends:.2f} mm at most: gravity hardly bends the robot in these"
            " poses; release it with its axis well away from the vertical"
        )
    fitted = np.ones(len(unknowns), dtype=bool)
    x = problem.solve(np.zeros(len(unknowns)), fitted)
    problem.sigma = problem.residual_sigma(x, noise.smallest * sigma)
    deviation = np.sqrt(np.diag(problem.covariance(x)))
    quantile = float(student.ppf(0.975, problem.freedom))
    names = [name_of(robot, unknown, creep_times) for unknown in unknowns]
    partners = partners_of(problem.information(x), unknowns, priors)
    reasons = [
        unfit(u, entry, half, quantile * half, [names[j] for j in others])
        for u, entry, half, others in zip(unknowns, x, deviation, partners)
    ]
    fitted = np.array([not reason for reason in reasons])
    x = problem.solve(np.where(fitted, x, 0.0), fitted)
    problem.sigma = problem.residual_sigma(x, noise.smallest * sigma)
    deviation = np.sqrt(np.diag(problem.covariance(x)))
    unseen = np.array([noise.stiffness * (unknown.kind == "modulus") for unknown in unknowns])
    after, parameters = problem.predict(x), parameters_at(x, unknowns, initial)
    estimates = tuple(
        estimate(robot, unknown, initial, parameters, quantile * half, half, reason, creep_times)
        for unknown, half, reason in zip(unknowns, np.hypot(deviation, unseen), reasons)
    )
    for unknown, entry in zip(unknowns, x):
        if unknown.kind == "modulus" and min(entry - unknown.lowest(initial), unknown.highest() - entry) < _AT_BOUND:
            raise MeasurementError(
                "no modulus describes these data: the best one is at the bound of its range. Are they of another robot, in"
                " other units, in another frame than soft_base, or mirrored?"
            )
    rms_before, rms_after = (rms_distance(found.tip[:, :3] - windows.tip_position) for found in (before, after))
    if own:
        check_explained(robot, rms_after)
    if problem.worse(x, np.zeros(len(x))):
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
        warnings=tuple(warnings(robot, unknowns, estimates, bool(np.isfinite(windows.displacement).any()))),
        creep_times=creep_times,
    )


def starting_parameters(robot: Robot, creep_times: tuple[float, ...]) -> StaticParameters:
    """Return the parameters of the robot as it is described, with the creep that it has in the branches of these times."""
    creep = np.zeros(len(creep_times))
    for ratio, time in robot.materials[0].branches if creep_times else ():
        creep[int(np.argmin(np.abs(np.log(np.array(creep_times) / time))))] += ratio
    moduli = np.array([material.youngs_modulus for material in robot.materials])
    return StaticParameters(moduli, np.zeros(len(robot.cables)), cable_compliance(robot), creep=creep)


def body_mass(robot: Robot) -> tuple[float, float, float]:
    """Return the mass in kg of what the density stands for, of the payload, and of the rest of the robot."""
    model = RobotModel(with_coarse_elements(robot))
    body, payload = float(model.body_weight.sum()), robot.payload.mass
    return body, payload, model.mass - body - payload


def cable_compliance(robot: Robot) -> np.ndarray:
    """Return (m,) the elongation in m/N of each cable from capstan to end, from the robot's description."""
    return np.array([robot.cable_compliance(cable) for cable in robot.cables])


class _Problem:
    """Residuals and Jacobian of the fit as functions of x. Keeps predictions; evaluations: number of them.

    sigma (2,): deviations of position in m and of direction; prior (q, u): rows of its residuals.
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
        self._expected = np.zeros(len(prior))
        self._progress = progress
        windows = predictor.windows
        self._directed = windows.tip_direction is not None
        parts = [windows.tip_position] if windows.tip_direction is None else [windows.tip_position, windows.tip_direction]
        self._measured, self._root = np.hstack(parts), np.sqrt(windows.shares)
        self._known: dict[bytes, StaticPrediction] = {}
        self._slopes: list[tuple[np.ndarray, np.ndarray]] = []
        self._moduli = np.array([unknown.kind == "modulus" for unknown in unknowns])

    def weigh(self, mass: float, body: float, payload: float, rest: float, deviation: float) -> None:
        """Hold density and payload to a weighed mass in kg with a relative deviation; the others: as described, in kg."""
        row = np.zeros(len(self._unknowns))
        for i, unknown in enumerate(self._unknowns):
            row[i] = unknown.scale * {"density": body, "payload": payload}.get(unknown.kind, 0.0) / (deviation * mass)
        self._prior = np.vstack([self._prior, row])
        self._expected = np.append(self._expected, (mass - body - payload - rest) / (deviation * mass))

    def bending(self, x: np.ndarray) -> float:
        """Return the farthest that a tip would move in m by e times all moduli."""
        columns = [i for i, unknown in enumerate(self._unknowns) if unknown.kind == "modulus"]
        return float(np.linalg.norm(self._by(x)[:, :3, columns].sum(axis=2), axis=1).max())

    @property
    def freedom(self) -> int:
        """Degrees of freedom of the residuals: a direction has two."""
        return max(1, round((self._root**2).sum()) * (5 if self._directed else 3) - len(self._unknowns))

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
        """Return the minimum over the entries `fitted` (u,) bool of x; the others keep those of `start`.

        Gauss-Newton's method with bounds; a step that does not help is halved.
        """
        from scipy.optimize import lsq_linear

        low = np.array([unknown.lowest(self._initial) for unknown in self._unknowns])[fitted]
        high = np.array([unknown.highest() for unknown in self._unknowns])[fitted]
        x = start.copy()
        cost = float((self.residuals(x) ** 2).sum())
        for _ in range(_MOST_STEPS):
            rows = self.jacobian(x)[:, fitted]
            step = np.zeros(len(x))
            step[fitted] = lsq_linear(rows, -self.residuals(x), (low - x[fitted] - _ROOM, high - x[fitted] + _ROOM)).x
            step[fitted] = np.clip(step[fitted], low - x[fitted], high - x[fitted])
            for part in _PARTS:
                there = x + part * step
                try:
                    new = float((self.residuals(there) ** 2).sum())
                except RuntimeError:  # no equilibrium with these parameters
                    continue
                if new < cost:
                    break
            else:
                return x
            x, gained, cost = there, cost - new, new
            if gained < _SETTLED * cost:
                return x
        return x

    def errors(self, x: np.ndarray) -> np.ndarray:
        """Return modelled minus measured tips (k, 3 or 6), position in m and direction."""
        return self.predict(x).tip[:, : self._measured.shape[1]] - self._measured

    def residual_sigma(self, x: np.ndarray, smallest: np.ndarray) -> np.ndarray:
        """Return the deviations (2,) that the residuals at x show, at least `smallest` (2,)."""
        error, count = self.errors(x) * self._root[:, None], (self._root**2).sum()
        shares = np.array([3.0, 2.0 if self._directed else 0.0]) * count
        # Position and direction use up the unknowns in proportion to their numbers.
        used = shares * (1.0 - min(len(self._unknowns) / shares.sum(), 0.9))
        found = [np.sqrt((part**2).sum() / max(count, 1.0)) for part, count in zip((error[:, :3], error[:, 3:]), used)]
        return np.maximum(found, smallest)

    def worse(self, x: np.ndarray, start: np.ndarray) -> bool:
        """Return whether x describes positions, directions or both together worse than `start`."""
        one, other = (self._scaled(self.errors(at)) ** 2 for at in (x, start))
        parts = (slice(0, 3), slice(3, 6), slice(0, 6)) if self._directed else (slice(0, 3),)
        return any(float(one[:, part].sum()) > float(other[:, part].sum()) for part in parts)

    def information(self, x: np.ndarray) -> np.ndarray:
        """Return what data and balance tell about x (u, u), without the prior."""
        own = len(self._unknowns)
        rows = self.jacobian(x)
        return rows.T @ rows - self._prior[:own].T @ self._prior[:own]

    def covariance(self, x: np.ndarray) -> np.ndarray:
        """Return the covariance (u, u) of x, with every unknown free."""
        rows = self.jacobian(x)
        return np.linalg.pinv(rows.T @ rows)

    def residuals(self, x: np.ndarray) -> np.ndarray:
        """Return the scaled tip errors and those of the prior."""
        return np.concatenate([self._scaled(self.errors(x)).ravel(), self._prior @ x - self._expected])

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """Return the derivative of the residuals by x."""
        width = self._measured.shape[1]
        columns = [self._scaled(column[:, :width]).ravel() for column in np.moveaxis(self._by(x), 2, 0)]
        return np.concatenate([np.column_stack(columns), self._prior])

    def _by(self, x: np.ndarray) -> np.ndarray:
        """Return the derivatives (k, 6, u) of the tips by x; those of a point near enough serve as well."""
        near = next((slopes for at, slopes in self._slopes if np.abs(at - x)[self._moduli].max() < _NEAR), None)
        if near is None:
            kinds = {unknown.kind for unknown in self._unknowns}
            found = self._predictor.differentiate(parameters_at(x, self._unknowns, self._initial), kinds)
            near = np.stack([unknown.derivative(found) for unknown in self._unknowns], axis=2)
            self._slopes.append((x, near))
            self._progress(f"evaluation {self.evaluations}: derivatives")
        return near

    def _scaled(self, rows: np.ndarray) -> np.ndarray:
        """Return rows (k, 3 or 6) of positions and directions over their deviations, by their windows' weights."""
        return self._root[:, None] * rows / np.repeat(self.sigma, 3)[: rows.shape[1]]
