"""A Prony series fitted to a recorded relaxation or creep test.

Relaxation at a held strain: R(t) = R_inf (1 + sum_i rho_i exp(-t / T_i)), rho_i = g_i / (1 - sum g). Creep under a held load has
the compliance that belongs to the same branches: at a constant stress the strain e and what the branches hold, h, follow

    e + sum_i rho_i h_i = 1 / E_inf,      dh_i/dt = de/dt - h_i / T_i,

which is linear in h (`full_model.viscosity` has the same branches). The samples are averaged in steps of the logarithm of the
time. The number of terms is that of the smallest Bayesian information criterion (G. Schwarz, Ann. Stat. 6, 1978); intervals
hold at 95 % and follow from the Jacobian and what remains.
"""

import dataclasses

import numpy as np

from gravcomp.calibration.material_recording import MaterialTest
from gravcomp.calibration.measured import MeasurementError
from gravcomp.description import PronyTerm

MOST_TERMS = 5
_BINS, _USED = 60, 20  # steps of the logarithm of the time, and samples of each that are compared
_ENOUGH = 2.0  # what the criterion has to fall by for one more term
_LEAST_SHARE = 1e-4
_SHORT = 0.5  # part of the recording that a relaxation time may take


@dataclasses.dataclass(frozen=True)
class FittedTerm:
    """A term with its intervals at 95 %: half width of the share, and limits (low, high) of the time in s."""

    term: PronyTerm
    share_interval: float
    time_limits: tuple[float, float]


@dataclasses.dataclass(frozen=True)
class SeriesFit:
    """terms by increasing time; predicted (k,): the course at the test's times; error: RMS of what remains, relative."""

    terms: tuple[FittedTerm, ...]
    predicted: np.ndarray
    error: float
    notes: tuple[str, ...]

    @property
    def prony(self) -> tuple[PronyTerm, ...]:
        """The series."""
        return tuple(fitted.term for fitted in self.terms)


def fit_series(test: MaterialTest) -> SeriesFit:
    """Return the Prony series of a test. Raises MeasurementError where nothing relaxes or creeps beyond the noise."""
    averages = _Averages.of(test)
    best = _Fit.of(averages, 0)
    for count in range(1, MOST_TERMS + 1):
        fit = _Fit.of(averages, count)
        if fit.criterion > best.criterion - _ENOUGH:
            break
        best = fit
    ratio, times = best.branches
    share = ratio / (1.0 + ratio.sum())
    if len(share) == 0 or share.max() < _LEAST_SHARE:
        raise MeasurementError(f"{test.source}: {test.column} shows no {test.what} beyond its noise")
    deviation = best.covariance()
    slope = np.diag(share) - np.outer(share, share)  # of the shares by the logarithms of the ratios
    count = len(share)
    half = 1.96 * np.sqrt(np.diag(slope @ deviation[1 : 1 + count, 1 : 1 + count] @ slope))
    spread = np.exp(np.minimum(1.96 * np.sqrt(np.diag(deviation)[1 + count :]), 50.0))
    terms = tuple(
        FittedTerm(PronyTerm(float(share[i]), float(times[i])), float(half[i]), (times[i] / spread[i], times[i] * spread[i]))
        for i in np.argsort(times)
    )
    predicted = np.exp(best.x[0]) * course(ratio, times, test.time, test.creep)
    error = float(np.sqrt(np.mean((predicted / test.value - 1.0) ** 2)))
    return SeriesFit(terms, predicted, error, tuple(_notes(test, terms)))


def course(ratio: np.ndarray, times: np.ndarray, time: np.ndarray, creep: bool) -> np.ndarray:
    """Return relaxation or creep (k,) at times (k,) in s, over what they become after a long time.

    ratio, times (b,): stiffness of each branch over the long-term stiffness, and its relaxation time in s.
    """
    if not creep:
        return 1.0 + np.exp(-time[:, None] / times) @ ratio
    start = 1.0 / (1.0 + ratio.sum())
    # With h = D g, D = diag(sqrt(T / rho)), the rate of g is symmetric.
    root = np.sqrt(ratio / times)
    rate, modes = np.linalg.eigh(start * np.outer(root, root) - np.diag(1.0 / times))
    begun = modes.T @ (start * root)
    held = np.sqrt(ratio * times) @ modes
    return 1.0 - np.exp(time[:, None] * rate) @ (held * begun)


@dataclasses.dataclass(frozen=True)
class _Averages:
    """Averages of a test in equal steps of the logarithm of the time: the samples that are used, and the step of each."""

    time: np.ndarray
    number: np.ndarray
    count: np.ndarray
    value: np.ndarray
    creep: bool

    @staticmethod
    def of(test: MaterialTest) -> "_Averages":
        step = np.log(test.time / test.time[0]) / np.log(test.time[-1] / test.time[0]) * _BINS
        _, first, number = np.unique(np.minimum(step.astype(int), _BINS - 1), return_index=True, return_inverse=True)
        count = np.bincount(number)
        stride = np.ceil(count / _USED).astype(int)[number]
        used = (np.arange(len(number)) - first[number]) % stride == (stride - 1) // 2
        return _Averages(test.time[used], number[used], count, np.bincount(number, test.value) / count, test.creep)

    def residuals(self, x: np.ndarray) -> np.ndarray:
        """Relative differences of the averages, over their deviation."""
        count = len(x) // 2
        values = np.exp(x[0]) * course(np.exp(x[1 : 1 + count]), np.exp(x[1 + count :]), self.time, self.creep)
        predicted = np.bincount(self.number, values) / np.bincount(self.number)
        return np.sqrt(self.count / self.count.mean()) * (predicted / self.value - 1.0)


@dataclasses.dataclass(frozen=True)
class _Fit:
    """A fit with a number of terms. x: logarithms of the long-term value, of the ratios, and of the times."""

    x: np.ndarray
    jacobian: np.ndarray
    residuals: np.ndarray

    @staticmethod
    def of(averages: _Averages, count: int) -> "_Fit":
        from scipy.optimize import least_squares

        time, value = averages.time, averages.value
        low, high = np.log(time[0] / 3.0), np.log(3.0 * time[-1])
        places = low + (high - low) * (np.arange(count) + 0.5) / max(count, 1)
        whole = max(abs(np.log(value[0] / value[-1])), 1e-3)
        start = np.concatenate([[np.log(value[-1])], np.full(count, np.log(whole / max(count, 1))), places])
        bounds = (
            np.concatenate([[-np.inf], np.full(count, -14.0), np.full(count, low)]),
            np.concatenate([[np.inf], np.full(count, 4.0), np.full(count, high)]),
        )
        found = least_squares(averages.residuals, start, bounds=bounds, x_scale="jac")
        return _Fit(found.x, found.jac, found.fun)

    @property
    def branches(self) -> tuple[np.ndarray, np.ndarray]:
        """Ratios and times (b,)."""
        count = len(self.x) // 2
        return np.exp(self.x[1 : 1 + count]), np.exp(self.x[1 + count :])

    @property
    def criterion(self) -> float:
        """The Bayesian information criterion."""
        number = len(self.residuals)
        remaining = max(float(self.residuals @ self.residuals), 1e-24)
        return number * float(np.log(remaining / number)) + len(self.x) * float(np.log(number))

    def covariance(self) -> np.ndarray:
        """Covariance of x."""
        free = max(len(self.residuals) - len(self.x), 1)
        return np.linalg.pinv(self.jacobian.T @ self.jacobian) * float(self.residuals @ self.residuals) / free


def _notes(test: MaterialTest, terms: tuple[FittedTerm, ...]) -> list[str]:
    """What the recording does not determine."""
    notes, end = [], test.time[-1]
    for fitted in terms:
        term, name = fitted.term, f"the term of {fitted.term.time:.3g} s"
        if term.time > _SHORT * end:
            notes.append(f"{name}: the recording of {end:.3g} s is too short for it; record at least {4.0 * term.time:.2g} s")
        elif term.time < test.time[0]:
            notes.append(f"{name} is faster than the first sample, at {test.time[0]:.3g} s; its share is extrapolated")
        if fitted.share_interval > 0.5 * term.share:
            notes.append(f"{name}: its share of {term.share:.3g} is uncertain by ± {fitted.share_interval:.2g}")
    return notes
