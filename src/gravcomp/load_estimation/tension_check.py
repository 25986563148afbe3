"""Names what is wrong with tension sensors: sign, stuck, not zeroed."""

import numpy as np

_STUCK = 25  # equal readings in a row: a sensor in use has noise
_SMOOTHED = 0.05  # of the newest reading in the mean
_NEGATIVE, _OFF = 0.02, 0.05  # of the largest tension: a cable cannot push; a slack cable reads nothing
_LEAST = 50  # readings before a mean counts


class TensionCheck:
    """Watches the tension sensors of a robot's cables."""

    def __init__(self, names: tuple[str, ...], tension_max: float):
        """tension_max in N."""
        self._names, self._largest = names, tension_max
        self._last = np.full(len(names), np.nan)
        self._equal, self._count = np.zeros(len(names), int), 0
        self._mean, self._expected = np.zeros(len(names)), np.zeros(len(names))

    def observe(self, tension: np.ndarray, expected: np.ndarray) -> str:
        """Take readings (m,) N and what the model expects; return what is wrong, empty for nothing."""
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
        stuck = (self._equal >= _STUCK) & ((self._mean != 0.0) | (self._expected > _OFF * self._largest))
        if stuck.any():
            return f"the tension sensor of {self._of(stuck)} is stuck at {tension[stuck][0]:.4g} N"
        if self._count < _LEAST:
            return ""
        sign = (self._mean < -_NEGATIVE * self._largest) & (self._expected > _NEGATIVE * self._largest)
        if sign.any():
            return f"the tension sensor of {self._of(sign)} has the wrong sign: {self._mean[sign][0]:.3g} N on a taut cable"
        off = (np.abs(self._mean) > _OFF * self._largest) & (self._expected < 1e-6 * self._largest)
        negative = self._mean < -_NEGATIVE * self._largest
        if (off | negative).any():
            found = off | negative
            return (
                f"the tension sensor of {self._of(found)} is not zeroed: it reads {self._mean[found][0]:.3g} N on a slack cable"
            )
        return ""

    def _of(self, chosen: np.ndarray) -> str:
        return ", ".join(name for name, one in zip(self._names, chosen) if one)
