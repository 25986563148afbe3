"""Values: clipped at a range, stuck, coarsely quantised."""

import numpy as np

from gravcomp.stream_checks.finding import Block, Finding

CLIPPED = 5  # samples at the extreme, each next to another one there
STUCK = 0.5  # s with the same three values
# A step of the values from which a sensor is coarse: 16 bit have 0.06 deg/s and 0.005 m/s^2, 8 bit 2 to 16 deg/s and 0.15 m/s^2.
COARSE = {"gyro": 0.004, "accel": 0.06}  # rad/s, m/s^2
EXTREME = {"gyro": 0.35, "accel": 12.0}  # rad/s, m/s^2: a smaller extreme is no range
NAMES = {"gyro": "the gyroscope", "accel": "the accelerometer"}


class Values:
    """Values of one sensor, `name`: gyro or accel."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._extreme = np.zeros(3)
        self._clipped = np.zeros(3)
        self._run = self._stuck = 0.0
        self._last: np.ndarray | None = None
        self._same = self._small = self._changes = 0.0

    def forget(self, keep: float) -> None:
        """Multiply all counts by `keep`."""
        self._clipped *= keep
        for name in ("_stuck", "_same", "_small", "_changes"):
            setattr(self, name, keep * getattr(self, name))

    def take(self, block: Block) -> None:
        """Look at a block."""
        values = getattr(block, self._name)
        size = np.abs(values)
        extreme = size.max(axis=0)
        higher = extreme > self._extreme * (1.0 + 1e-4)
        self._extreme = np.where(higher, extreme, self._extreme)
        self._clipped[higher] = 0.0
        at = size >= self._extreme * (1.0 - 1e-4)
        self._clipped += np.count_nonzero(at[1:] & at[:-1], axis=0)

        before = values[:1] if self._last is None else self._last[None]
        change = np.abs(np.diff(np.concatenate([before, values]), axis=0))
        same = (change == 0.0).all(axis=1)
        for still in same.tolist():
            self._run = self._run + block.period if still else 0.0
            self._stuck = max(self._stuck, self._run)
        self._last = values[-1]
        self._changes += change.size
        self._same += np.count_nonzero(change == 0.0)
        self._small += np.count_nonzero((change > 0.0) & (change < COARSE[self._name]))

    def findings(self) -> list[Finding]:
        """Return what is odd."""
        found, name = [], NAMES[self._name]
        coarse = self._changes and self._same > 0.05 * self._changes and self._small < 0.002 * self._changes
        if coarse:
            found.append(Finding(f"{self._name}_quantised", f"{name} is coarsely quantised: an orientation follows its steps"))
        elif self._stuck >= STUCK:
            found.append(Finding(f"{self._name}_stuck", f"{name} repeats the same values for up to {self._stuck:.1f} s"))
        clipped = (self._clipped >= CLIPPED) & (self._extreme > EXTREME[self._name])
        if clipped.any() and self._stuck < STUCK:
            axes = ", ".join(axis for axis, yes in zip("xyz", clipped) if yes)
            found.append(Finding(f"{self._name}_clipped", f"{name} is clipped at its range on {axes}: a larger range is needed"))
        return found
