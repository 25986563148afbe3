"""What a sensor likely turned while samples were missing, from the rates around the gap.

The motion is taken for a smooth random one (a Gaussian process). Over a time t its rates are correlated by

    r = (1 + a + a^2 / 3) exp(-a),    a = sqrt(3) f t,

with the angular frequency f = RMS of w' / RMS of w (C. E. Rasmussen, C. K. I. Williams, Gaussian Processes for Machine Learning,
MIT Press 2006, ch. 2 and 4: Matern, 5/2). Then the angle turned in the gap and the rates around it have a joint normal
distribution: the likeliest angle is a weighted sum of those rates, and its variance is known. In a gap that is long for the
motion the weights approach a limit, because the rates decay as fast as they swing, and the variance is that of any such motion.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

_ROOT = math.sqrt(3.0)
_LEAST = 1e-5  # of the variance: more noise than this keeps the equations solvable


class Swing(NamedTuple):
    """A motion: variance of its rate on each axis, (rad/s)^2, and the angular frequency of its swings, rad/s."""

    variance: float
    frequency: float


def likeliest_turn(
    swings: Sequence[Swing], times: Sequence[float], noise: Sequence[float], gap: float
) -> tuple[list[float], float]:
    """Return the weights (n,) in s of rates for the angle turned from 0 to `gap` s, and its variance on each axis, rad^2.

    swings: independent parts of the motion; times (n,) s and noise (n,), (rad/s)^2, of the rates that are known.
    """
    count, variance = len(times), 0.0
    between = [[0.0] * count for _ in times]  # covariance of the rates
    angle = [0.0] * count  # covariance of the rates with the angle
    for size, f in swings:
        for i, time in enumerate(times):
            angle[i] += size / f * (_once(f * (gap - time)) + _once(f * time))
            for j in range(i + 1):
                between[i][j] += size * _correlation(f * (time - times[j]))
        variance += 2.0 * size / (f * f) * _twice(f * gap)
    for i, least in enumerate(noise):
        between[i][i] += least + _LEAST * between[i][i]
    # Cholesky: between = L L^T; a weight is what L^-T L^-1 makes of the covariance with the angle.
    weights: list[float] = []
    for i in range(count):
        row = between[i]
        for j in range(i + 1):
            left = row[j] - sum(row[k] * between[j][k] for k in range(j))
            row[j] = math.sqrt(left) if i == j else left / between[j][j]
        weights.append((angle[i] - sum(row[k] * weights[k] for k in range(i))) / row[i])
    variance -= sum(weight * weight for weight in weights)
    for i in reversed(range(count)):
        weights[i] = (weights[i] - sum(between[k][i] * weights[k] for k in range(i + 1, count))) / between[i][i]
    return weights, max(variance, 0.0)


def _correlation(x: float) -> float:
    """Return the correlation r of two rates, x = f t."""
    a = _ROOT * abs(x)
    return (1.0 + a + a * a / 3.0) * math.exp(-a)


def _once(x: float) -> float:
    """Return the integral of r from 0 to x."""
    a = _ROOT * abs(x)
    return math.copysign((8.0 - (8.0 + 5.0 * a + a * a) * math.exp(-a)) / (3.0 * _ROOT), x)


def _twice(x: float) -> float:
    """Return the integral of `_once` from 0 to x."""
    a = _ROOT * abs(x)
    return (8.0 * a - 15.0 + (15.0 + 7.0 * a + a * a) * math.exp(-a)) / 9.0
