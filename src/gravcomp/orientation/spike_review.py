"""Second look at the samples of a sensor, some samples later: each one between its neighbours on both sides.

In fast motion no rule can tell a spike from the samples before it: at 95 Hz the rate of a shaken hand changes by 60 deg/s from
sample to sample. With the samples after it the same motion is a smooth curve, to within a few deg/s. So a polynomial is fitted by
least squares to the sample in question and its neighbours, once with all of them and once without each one or two that may be
spikes. The fit counts that has the smallest squared residual, where each sample that is left out costs a constant (a truncated
quadratic: A. Blake, A. Zisserman, Visual Reconstruction, MIT Press 1987, ch. 3). Each axis has its own fit.

Slow motion and vibration are no such curve. There the median of the neighbours is nearer, and three spikes among them do not
move it, while a polynomial swings with the vibration, and three spikes bend it. So the median counts as long as a curve was not
nearer to the last samples than the mean of their neighbours.

A spike that is no larger than the vibration cannot be found. It is noise, which `vibration` measures with the rest.
"""

import itertools
from collections import deque

import numpy as np

from gravcomp.orientation.quaternion import Vector
from gravcomp.orientation.spikes import BOUND, SpikeOptions

BEFORE, AHEAD = 5, 4  # samples of the fit before and after the one in question
DEGREE = 4
# Of the threshold of a curve, as in `last_steps`: an angle lacks for good what a wrong spike removes.
SURE_GYRO, SURE_ACCEL = 2.0, 1.0
# Of the threshold of a jump, for the distance from the median: in vibration 1.1 times its RMS, a jump 1.4 times.
FROM_MEDIAN = 0.75
WITH_IT = 0.25  # of that: where one axis has a spike, the others are likely to have one
STRAIGHT = 0.1  # of the floor: by how much a curve may be nearer to the last samples than their mean where the median counts
_LEFT_OUT = 0.1  # cost of a sample that is left out, in squared thresholds times the residual's share of a single spike
_MOST = 2  # spikes among the samples of a fit
# Weights of six neighbours and the sample between them: its distance from the polynomial of degree five through them.
_NEAR, _FAR, _FARTHEST = 0.75, -0.3, 0.05


def _fits() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return for each of h choices of left out samples: residuals (h, n, n), value (h, n), number (h,), with ours or not (h,)."""
    count = BEFORE + 1 + AHEAD
    powers = np.vander(np.arange(-BEFORE, AHEAD + 1.0), DEGREE + 1, increasing=True)
    choices = [left for size in range(_MOST + 1) for left in itertools.combinations(range(BEFORE, count), size)]
    residuals, values = [], []
    for left in choices:
        kept = np.ones((count, 1))
        kept[list(left)] = 0.0
        fitted = powers @ np.linalg.pinv(powers * kept) * kept.T
        residuals.append((np.eye(count) - fitted) * kept)
        values.append(fitted[BEFORE])
    sizes = np.array([len(left) for left in choices], float)
    return np.array(residuals), np.array(values), sizes, np.array([BEFORE in left for left in choices])


_RESIDUALS, _VALUES, _SIZES, _HAS_OURS = _fits()
_COST = _LEFT_OUT * float(_RESIDUALS[0][BEFORE, BEFORE])


class SpikeReview:
    """One sensor of three axes. What it returns is final, so that the samples before one in question are without spikes."""

    def __init__(self, floor: float, options: SpikeOptions, sure: float):
        """floor: a smaller distance is no spike; sure: of the threshold, from which a sample that is far from a curve is one."""
        self._floor, self._options, self._sure = floor, options, sure
        self._samples: deque[Vector] = deque(maxlen=BEFORE + 1 + AHEAD)
        self.reset()

    def reset(self) -> None:
        """Forget the samples: what follows is no continuation of them."""
        self._samples.clear()
        self._mean = self._mean_from_median = 0.0
        self._bend = self._floor  # a curve, as long as nothing is known

    def take(self, dt: float, value: Vector) -> Vector | None:
        """Take the value (3,) of a sample `dt` s after the last one; return what counts for the one AHEAD samples before it.

        None while there are too few samples for a decision.
        """
        samples = self._samples
        samples.append(value)
        if len(samples) <= BEFORE + AHEAD:
            return None
        ours = samples[BEFORE]
        distance, off, bend, middle = self._look()
        threshold, from_median = self._threshold(self._mean), self._threshold(self._mean_from_median)
        part = dt / (self._options.time_constant + dt)
        self._mean += part * (min(distance, BOUND * threshold) - self._mean)
        self._mean_from_median += part * (min(off, BOUND * from_median) - self._mean_from_median)
        self._bend += part * (max(-self._floor, bend) - self._bend)
        least = max(self._floor, FROM_MEDIAN * from_median)
        is_far = off > least and distance > self._floor
        if self._bend <= STRAIGHT * self._floor and not (is_far and self._goes_on(middle, least)):
            if not is_far:
                return ours
            decided = middle  # on all axes: a rest would end at what is left of the spike
        elif distance <= threshold:
            return ours
        else:
            decided = self._decided(self._sure * threshold)
        samples[BEFORE] = decided
        return decided

    def _threshold(self, mean: float) -> float:
        threshold = self._options.ratio * mean
        return self._floor if self._floor > threshold else threshold

    def _goes_on(self, middle: Vector, least: float) -> bool:
        """Return whether most samples after the one in question are far from the median, too: that is motion which begins."""
        after = itertools.islice(self._samples, BEFORE + 1, None)
        return 2 * sum(max(abs(v - m) for v, m in zip(sample, middle)) > least for sample in after) > AHEAD

    def _look(self) -> tuple[float, float, float, Vector]:
        """Return how far the sample in question is from the curve and from the median, the bend, and the median (3,).

        Bend: by how much a cubic through four samples that are decided is nearer to the one between them than their mean is.
        """
        distance = off = from_mean = from_cubic = 0.0
        middle = []
        for a, b, c, d, e, ours, f, g, h, i in zip(*self._samples):
            away = abs(ours - _NEAR * (e + f) - _FAR * (d + g) - _FARTHEST * (c + h))
            distance = away if away > distance else distance
            around = sorted((b, c, d, e, f, g, h, i))
            median = 0.5 * (around[3] + around[4])
            middle.append(median)
            away = abs(ours - median)
            off = away if away > off else off
            near, far = b + d, a + e
            away = abs(c - 0.25 * (near + far))
            from_mean = away if away > from_mean else from_mean
            away = abs(c - (4.0 * near - far) / 6.0)
            from_cubic = away if away > from_cubic else from_cubic
        x, y, z = middle
        return distance, off, from_mean - from_cubic, (x, y, z)

    def _decided(self, threshold: float) -> Vector:
        """Return what counts for the sample in question: on each axis itself, or the curve where it is a spike."""
        values = np.array(self._samples)  # (n, 3)
        costs = np.square(_RESIDUALS @ values).sum(axis=1) + (_COST * threshold**2 * _SIZES)[:, None]
        ours, best = values[BEFORE], np.argmin(costs, axis=0)  # (3,) each
        without = np.argmin(np.where(_HAS_OURS[:, None], costs, np.inf), axis=0)
        curve = np.sum(_VALUES[without] * values.T, axis=1)
        off = np.abs(ours - curve)
        spike = _HAS_OURS[best] & (off > threshold)
        if spike.any():
            spike |= off > WITH_IT * threshold
        x, y, z = np.where(spike, curve, ours).tolist()
        return x, y, z
