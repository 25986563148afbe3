"""Scale of the rates: whether sample rate or gyroscope are wrong by 2, or whether the motion does not show it.

The rates are tried with several scales s. For each the means of the turned specific force over the windows of a stretch scatter
about their mean by r_w(b) = r_w + E_w b, where b is a bias of the rates: a bias turns gravity like a wrong scale where the
sensor hardly turns, so that for every scale the best b counts, with a prior of its deviation. E_w follows from the derivative

    d(R a)/db = [R a]x  P s,    P = integral of R dt,

and S(s) = min_b sum |r_w + E_w b|^2 / v + |b|^2 / deviation^2 is minus twice the logarithm of the likelihood, with the variance
v of what scatters by changes of the velocity.
"""

import numpy as np
from scipy.special import stdtrit

from gravcomp.stream_checks.finding import Finding

RATE_SCALES = {"half": 0.5, "less": 0.7, "same": 1.0, "more": 1.4, "double": 2.0}
KNOWN_BIAS = np.radians(0.2)  # rad/s, deviation after a rest
UNKNOWN_BIAS = np.radians(2.0)  # rad/s, of sensors in use
NOISE = (
    0.04  # weighted variance at least: gyroscope noise turns gravity by a tenth of a degree in a stretch, less with a small scale
)
CHANCE = 6e-5  # of a wrong report, as of four standard deviations


class RateScale:
    """Sums over the stretches of a stream, for each of the RATE_SCALES."""

    def __init__(self) -> None:
        self._start(rested=False)

    def _start(self, *, rested: bool) -> None:
        count = len(RATE_SCALES)
        self._square, self._linear, self._constant = np.zeros((count, 3, 3)), np.zeros((count, 3)), np.zeros(count)
        self._stretches = 0.0
        self._windows = 0
        self._rested = rested

    def forget(self, keep: float) -> None:
        """Multiply the sums by `keep`."""
        for values in (self._square, self._linear, self._constant):
            values *= keep
        self._stretches *= keep

    def take(self, steps: np.ndarray, turned: np.ndarray, weight: float, windows: int, *, rested: bool) -> None:
        """Add a stretch of m steps.

        steps (m, k, 3, 3): rotation to the frame at the begin, for each scale, times the duration of a step in s; turned
        (m, k, 3): the specific force turned back; weight: of the stretch; windows: of the stretch; rested: the bias is taken off.
        """
        if rested and not self._rested:
            self._start(rested=True)  # the stretches before have another bias
        scale = np.array(list(RATE_SCALES.values()))
        turns = -scale[:, None, None] * np.cumsum(steps, axis=0)  # d(rotation vector)/db, (m, k, 3, 3)
        change = np.cross(turns, turned[..., None], axisa=2, axisb=2, axisc=2)  # of the turned force
        residual = turned.reshape(windows, -1, *turned.shape[1:]).mean(axis=1)
        by_bias = change.reshape(windows, -1, *change.shape[1:]).mean(axis=1)
        residual, by_bias = residual - residual.mean(axis=0), by_bias - by_bias.mean(axis=0)
        self._square += weight * np.einsum("wkia,wkib->kab", by_bias, by_bias)
        self._linear += weight * np.einsum("wkia,wki->ka", by_bias, residual)
        self._constant += weight * np.einsum("wki,wki->k", residual, residual)
        self._stretches += 1.0
        self._windows = windows

    @property
    def scatter(self) -> float:
        """The smallest weighted scatter of a stretch's windows, summed over the stretches."""
        return float(self._least(np.inf).min()) / max(self._windows, 1)

    def findings(self) -> list[Finding]:
        """Return whether the rates are wrong by 2."""
        left = self._left()
        if len(left) != 1 or left == ["same"]:
            return []
        text = f"the turns by the gyroscope are {'twice' if left == ['half'] else 'half'} those by the accelerometer"
        return [Finding("rate", f"{text}: the sample rate or the gyroscope's scale is wrong by 2")]

    def unknown(self) -> list[str]:
        """Return what the motion does not show, a sentence each."""
        if len(self._left()) == 1:
            return []
        return ["the motion does not show whether the sample rate or the gyroscope's scale is wrong by 2"]

    def _left(self) -> list[str]:
        """Return which of the right scale and those wrong by 2 the motion does not exclude.

        The likeliest scale may lie between two of them: other errors of the rates shift it.
        """
        likely = self._likelihood()
        return [name for name in ("half", "same", "double") if not likely or likely[name] < chance_square(self._degrees)]

    def _likelihood(self) -> dict[str, float]:
        """Return minus twice the logarithm of the likelihood of each scale, beyond that of the likeliest."""
        if self._degrees < 1.0:
            return {}
        variance = max(float(self._least(np.inf).min()) / self._degrees, NOISE)
        sums = self._least(KNOWN_BIAS if self._rested else UNKNOWN_BIAS, variance) / variance
        return dict(zip(RATE_SCALES, (sums - sums.min()).tolist()))

    @property
    def _degrees(self) -> float:
        """Degrees of freedom that scale and bias leave."""
        return 3.0 * (self._windows - 1.0) * self._stretches - 4.0

    def _least(self, deviation: float, variance: float = 0.0) -> np.ndarray:
        """Return the weighted sums of squares (k,) with the best bias; deviation: of the bias in rad/s."""
        ridge = 1e-9 + variance / deviation**2
        bias = np.linalg.solve(self._square + ridge * np.eye(3), -self._linear[..., None])[..., 0]
        return self._constant + np.einsum("ka,ka->k", self._linear, bias)


def chance_square(degrees: float, trials: int = 1) -> float:
    """Return the largest gain of likelihood by chance: the variance is estimated with `degrees` of freedom, from few badly."""
    return float(stdtrit(degrees, 1.0 - 0.5 * CHANCE / trials)) ** 2
