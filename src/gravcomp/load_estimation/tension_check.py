"""Names what is wrong with tension sensors: sign, stuck, not zeroed."""

import numpy as np

_STUCK = 25  # equal readings in a row: a sensor in use has noise
_SMOOTHED = 0.05  # of the newest reading in the mean
_NEGATIVE, _OFF = 2.0, 5.0  # expected zero errors: a cable cannot push; a slack cable reads nothing
_SLACK = 1e-6  # of the largest tension: what the model has in a slack cable
_MODEL = 0.5  # of the expected tension: by so much the model of a robot without load may be wrong
LEAST = 50
"""Readings after which a fault is found: fewer say nothing about a sensor."""


class TensionCheck:
    """Watches the tension sensors of a robot's cables."""

    def __init__(self, names: tuple[str, ...], tension_max: float, offset: float):
        """tension_max in N; offset in N: expected zero error of a sensor."""
        self._names, self._largest, self._offset = names, tension_max, offset
        self._not_zeroed = np.zeros(len(names), bool)  # as found without load
        self._last = np.full(len(names), np.nan)
        self._equal, self._count = np.zeros(len(names), int), 0
        self._mean, self._expected = np.zeros(len(names)), np.zeros(len(names))

    @property
    def is_known(self) -> bool:
        """Whether enough was read to know that the sensors are right."""
        return self._count >= LEAST

    def observe(self, tension: np.ndarray, expected: np.ndarray, unloaded: bool = False) -> str:
        """Take readings (m,) N and what the model expects; return what is wrong, empty for nothing.

        unloaded: the robot carries nothing, so that a taut cable's zero shows, too.
        """
        if tension.shape != self._last.shape:
            return f"{tension.size} tensions for {len(self._names)} cables"
        if not np.isfinite(tension).all():
            return f"the tension of {self._of(~np.isfinite(tension))} is not a finite number"
        if (np.abs(tension) > 10.0 * self._largest).any():
            far = np.abs(tension) > 10.0 * self._largest
            return (
                f"the tension of {self._of(far)} is {tension[far][0]:.4g} N; limits.tension_max is {self._largest:g} N: its unit?"
            )
        self._equal = np.where(tension == self._last, self._equal + 1, 0)
        self._last = tension.copy()
        share = max(_SMOOTHED, 1.0 / (self._count + 1))
        self._mean += share * (tension - self._mean)
        self._expected += share * (expected - self._expected)
        self._count += 1
        stuck = (self._equal >= _STUCK) & ((self._mean != 0.0) | (self._expected > _OFF * self._offset))
        if stuck.any():
            return f"the tension sensor of {self._of(stuck)} is stuck at {tension[stuck][0]:.4g} N"
        if not self.is_known:
            return ""
        negative = self._mean < -_NEGATIVE * self._offset
        sign = negative & (self._expected > _NEGATIVE * self._offset)
        if sign.any():
            return f"the tension sensor of {self._of(sign)} has the wrong sign: {self._mean[sign][0]:.3g} N on a taut cable"
        off = negative | ((np.abs(self._mean) > _OFF * self._offset) & (self._expected < _SLACK * self._largest))
        if off.any():
            return f"the tension sensor of {self._of(off)} is not zeroed: it reads {self._mean[off][0]:.3g} N on a slack cable"
        if unloaded:
            self._not_zeroed = np.abs(self._mean - self._expected) > _OFF * self._offset + _MODEL * self._expected
        if self._not_zeroed.any():
            off = self._not_zeroed
            return (
                f"the tension sensor of {self._of(off)} is not zeroed: it reads {self._mean[off][0]:.3g} N"
                f" where the model without load has {self._expected[off][0]:.3g} N"
            )
        return ""

    def _of(self, chosen: np.ndarray) -> str:
        return ", ".join(name for name, one in zip(self._names, chosen) if one)
