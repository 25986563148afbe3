"""The least squares of a static fit: residuals and Jacobian as functions of x, and the search for their minimum."""

from collections.abc import Callable
from typing import Protocol

import numpy as np

from gravcomp.calibration.measured import StillWindows, rms_distance
from gravcomp.calibration.noise_limit import open_error
from gravcomp.calibration.parameters import StaticParameters
from gravcomp.calibration.statics import StaticPrediction
from gravcomp.calibration.unknowns import Unknown, parameters_at

_MOST_STEPS, _SETTLED = 8, 3e-3  # of the search, and the relative gain with which it ends
_PARTS = (1.0, 0.5, 0.2)  # of a step, and of the way from the described robot to the first point of a search
_ROOM = 1e-9  # of the bounds of a step, which must not be empty
_CHANCE = 3.84  # squares over their variance, one degree of freedom at 95 %
_NEAR = 0.02  # in the moduli's logarithms, over which derivatives hardly change


class Predictor(Protocol):
    """What predicts the tips of the windows."""

    windows: StillWindows

    def predict(self, parameters: StaticParameters) -> StaticPrediction:
        """Return the prediction. Raises RuntimeError if there is no equilibrium."""

    def differentiate(self, parameters: StaticParameters, kinds: set[str]) -> dict[str, np.ndarray]:
        """Return the derivatives (k, 6, n) of the tips by each of the kinds, at least. Raises RuntimeError as `predict`."""


class Problem:
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
        self.add(row[None], np.array([(mass - body - payload - rest) / (deviation * mass)]))

    def add(self, rows: np.ndarray, expected: np.ndarray) -> None:
        """Add data that no tip shows: rows (k, u) of x and what is expected of them (k,), over their deviations."""
        self._prior, self._expected = np.vstack([self._prior, rows]), np.concatenate([self._expected, expected])

    def bending(self, x: np.ndarray) -> float:
        """Return the farthest that a tip would move in m by e times all moduli."""
        columns = [i for i, unknown in enumerate(self._unknowns) if unknown.kind == "modulus"]
        return float(np.linalg.norm(self._by(x)[:, :3, columns].sum(axis=2), axis=1).max())

    def freedom(self, x: np.ndarray) -> int:
        """Return the degrees of freedom of the residuals at x: a direction has two.

        An unknown uses up the share of one that the tips tell of it, and no more where its prior does; all of them the trace of
        the hat matrix (J. Ye, "On measuring and correcting the effects of data mining and model selection", JASA 93, 1998).
        """
        tips = self.jacobian(x)[: -len(self._prior)]
        used = float(np.sum((tips.T @ tips) * self.covariance(x)))
        return max(1, round(float((self._root**2).sum()) * (5 if self._directed else 3) - used))

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

        Gauss-Newton's method with bounds; a step that does not help is halved, and so is one to a point without equilibrium. If
        `start` has none, the search begins nearer to x = 0, the described robot. Raises RuntimeError if that has none either.
        """
        from scipy.optimize import lsq_linear

        low = np.array([unknown.lowest(self._initial) for unknown in self._unknowns])[fitted]
        high = np.array([unknown.highest() for unknown in self._unknowns])[fitted]
        x = self._with_equilibrium(start)
        cost = self._cost(x)
        for _ in range(_MOST_STEPS):
            rows = self.jacobian(x)[:, fitted]
            step = np.zeros(len(x))
            step[fitted] = lsq_linear(rows, -self.residuals(x), (low - x[fitted] - _ROOM, high - x[fitted] + _ROOM)).x
            step[fitted] = np.clip(step[fitted], low - x[fitted], high - x[fitted])
            for part in _PARTS:
                there = x + part * step
                new = self._cost(there)
                if new < cost:
                    break
            else:
                return x
            x, gained, cost = there, cost - new, new
            if gained < _SETTLED * cost:
                return x
        return x

    def _with_equilibrium(self, start: np.ndarray) -> np.ndarray:
        """Return the first point on the way from `start` to x = 0 that has a prediction, else x = 0."""
        return next((part * start for part in _PARTS if np.isfinite(self._cost(part * start))), np.zeros_like(start))

    def _cost(self, x: np.ndarray) -> float:
        """Return the sum of squares, infinite where there is no equilibrium; at x = 0 that raises RuntimeError."""
        try:
            return float((self.residuals(x) ** 2).sum())
        except RuntimeError:
            if not x.any():
                raise
            self._progress(f"evaluation {self.evaluations}: no equilibrium")
            return np.inf

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
        """Return whether x describes positions, directions or both together worse than `start`, by more than chance does."""
        one, other = (self._scaled(self.errors(at)) ** 2 for at in (x, start))
        parts = (slice(0, 3), slice(3, 6), slice(0, 6)) if self._directed else (slice(0, 3),)
        return any(float(one[:, part].sum()) > float(other[:, part].sum()) + _CHANCE for part in parts)

    def information(self, x: np.ndarray) -> np.ndarray:
        """Return what tips and other data tell about x (u, u), without the prior."""
        own = len(self._unknowns)
        rows = self.jacobian(x)
        return rows.T @ rows - self._prior[:own].T @ self._prior[:own]

    def covariance(self, x: np.ndarray) -> np.ndarray:
        """Return the covariance (u, u) of x, with every unknown free."""
        rows = self.jacobian(x)
        return np.linalg.pinv(rows.T @ rows)

    def open_error(self, x: np.ndarray) -> float:
        """Return the root mean square error in m of the tips that the covariance of x leaves."""
        return open_error(self._by(x)[:, :3], self.covariance(x), self._root**2)

    def residuals(self, x: np.ndarray) -> np.ndarray:
        """Return the scaled tip errors and those of the prior."""
        return np.concatenate([self._scaled(self.errors(x)).ravel(), self._prior @ x - self._expected])

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """Return the derivative of the residuals by x."""
        width = self._measured.shape[1]
        columns = [self._scaled(column[:, :width]).ravel() for column in np.moveaxis(self._by(x), 2, 0)]
        return np.concatenate([np.column_stack(columns), self._prior])

    def _by(self, x: np.ndarray) -> np.ndarray:
        """Return the derivatives (k, 6, u) of the tips by x; those of a point near enough serve as well.

        Where there are none, since shapes next to x have no equilibrium, those of the nearest point serve. Raises RuntimeError
        if there is none.
        """
        near = next((slopes for at, slopes in self._slopes if np.abs(at - x)[self._moduli].max() < _NEAR), None)
        if near is None:
            near = self._derivatives(x)
            self._slopes.append((x, near))
            self._progress(f"evaluation {self.evaluations}: derivatives")
        return near

    def _derivatives(self, x: np.ndarray) -> np.ndarray:
        """Return the derivatives as `_by`, computed at x where that is possible."""
        kinds = {unknown.kind for unknown in self._unknowns}
        try:
            found = self._predictor.differentiate(parameters_at(x, self._unknowns, self._initial), kinds)
        except RuntimeError:
            if not self._slopes:
                raise
            return min(self._slopes, key=lambda known: float(np.linalg.norm(known[0] - x)))[1]
        return np.stack([unknown.derivative(found) for unknown in self._unknowns], axis=2)

    def _scaled(self, rows: np.ndarray) -> np.ndarray:
        """Return rows (k, 3 or 6) of positions and directions over their deviations, by their windows' weights."""
        return self._root[:, None] * rows / np.repeat(self.sigma, 3)[: rows.shape[1]]
