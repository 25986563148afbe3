"""Least-squares fit of the chain with friction to measured tips of the robot with nine tendons.

The derivatives follow from the equilibrium g(b, x) = 0: dp/dx - dp/db (dg/db)^-1 dg/dx for the tip p(b, x), with difference
quotients of g and p alone, so that no equilibrium is computed for a derivative. Intervals hold at 95 % for residuals that are
alike within a pattern: the covariance is A^-1 (sum_g s_g s_g^T) A^-1 with the scores s_g of the patterns (K.-Y. Liang and S. L.
Zeger, Biometrika 73, 1986), and at least that of independent residuals.
"""

import dataclasses

import numpy as np

from gravcomp.experiments.measured.tdcr_model import COUNT, UNKNOWNS, Pulls, bends, chain, driven, predict, tips

_NOISE = 4e-3  # m
_OUTLIER = 3.0  # of _NOISE: tips farther off count less
_ROWS = 400  # that are fitted at most, spread evenly: neighbours on a ramp show the same
_STEP = 1e-5  # of x, in difference quotients
_PRIOR = np.concatenate([np.full(len(unknown.names), 1.0 / unknown.prior) for unknown in UNKNOWNS.values()])


@dataclasses.dataclass(frozen=True)
class ChainFit:
    """x; path: x of the fit without friction in the disks, whose bends say how they moved; half (n,): of the intervals of x."""

    x: np.ndarray
    path: np.ndarray
    half: np.ndarray

    def predict(self, pulls: Pulls, which: np.ndarray | slice = slice(None)) -> np.ndarray:
        """Return the tips (k, 3) in m of the rows `which`. pulls: all rows, in their order in time."""
        return predict(self.x, pulls.with_path(self.path).rows(np.arange(len(pulls.tip))[which]))


def fit(pulls: Pulls, which: np.ndarray, start: ChainFit | None = None) -> ChainFit:
    """Fit to the rows `which` (k,), booleans, of all rows in their order in time: all commands decide the friction."""
    rows = np.flatnonzero(which)
    rows = rows[:: max(1, -(-len(rows) // _ROWS))]
    path, _ = _least_squares(pulls.rows(rows), start.path if start else np.zeros(COUNT))
    chosen = pulls.with_path(path).rows(rows)
    x, half = _least_squares(chosen, start.x if start else path)
    return ChainFit(x, path, half)


def _least_squares(pulls: Pulls, start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return x, and the half widths of its intervals at 95 %."""
    from scipy.optimize import least_squares

    last: np.ndarray | None = None

    def residuals(x: np.ndarray) -> np.ndarray:
        nonlocal last
        last = bends(x, pulls, last)
        return np.concatenate([(tips(x, last) - pulls.tip).ravel() / _NOISE, _PRIOR * x])

    def jacobian(x: np.ndarray) -> np.ndarray:
        return np.vstack([_derivative(x, pulls, bends(x, pulls, last)) / _NOISE, np.diag(_PRIOR)])

    found = least_squares(residuals, start, jac=jacobian, loss="soft_l1", f_scale=_OUTLIER, xtol=1e-4, ftol=1e-4, max_nfev=20)
    derivative = _derivative(found.x, pulls, bends(found.x, pulls, last)) / _NOISE
    return found.x, 1.96 * np.sqrt(_variance(derivative, residuals(found.x)[: pulls.tip.size], pulls.pattern))


def _derivative(x: np.ndarray, pulls: Pulls, bent: np.ndarray) -> np.ndarray:
    """Return the derivatives (3 k, n) of the tips by x, at their bends (k, 3, 2)."""
    number = len(bent)
    left, slope = chain(x).unbalanced(bent, *driven(x, pulls))
    here, by_bend = tips(x, bent), np.empty((number, 3, bent[0].size))
    for entry in range(by_bend.shape[2]):
        moved = bent.copy().reshape(number, -1)
        moved[:, entry] += _STEP
        by_bend[:, :, entry] = (tips(x, moved.reshape(bent.shape)) - here) / _STEP
    by_load = np.linalg.solve(slope, by_bend.transpose(0, 2, 1)).transpose(0, 2, 1)  # the slope is symmetric
    columns = []
    for step in _STEP * np.eye(COUNT):
        other, _ = chain(x + step).unbalanced(bent, *driven(x + step, pulls))
        load = (other - left).reshape(number, -1) / _STEP
        columns.append(((tips(x + step, bent) - here) / _STEP - np.einsum("kij,kj->ki", by_load, load)).ravel())
    return np.column_stack(columns)


def _variance(derivative: np.ndarray, residual: np.ndarray, pattern: np.ndarray) -> np.ndarray:
    """Return the variances (n,) of x. residual (3 k,), derivative (3 k, n) over the noise; pattern (k,)."""
    group = np.unique(pattern, return_inverse=True)[1]
    score = np.einsum("kc,kcn->kn", residual.reshape(-1, 3), derivative.reshape(len(pattern), 3, -1))
    scores = np.stack([score[group == number].sum(axis=0) for number in range(group.max() + 1)])
    variance = float(residual @ residual) / max(1, residual.size - COUNT)
    inverse = np.linalg.pinv(derivative.T @ derivative + variance * np.diag(_PRIOR**2))
    return np.asarray(np.maximum(np.diag(variance * inverse), np.diag(inverse @ (scores.T @ scores) @ inverse)))
