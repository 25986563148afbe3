"""Values: clipped at a range, stuck, coarsely quantised.

What a value does is compared with the step between the sensor's values: a smooth maximum between two steps stays at the highest
of them for some samples, and a coarse sensor at rest repeats its values.
"""

import numpy as np

from gravcomp.stream_checks.finding import Block, Finding
from gravcomp.stream_checks.resting import LARGEST_BIAS, QUIET

CLIPPED = 5  # samples at the extreme, each next to another one there
STEEP = 1.5  # steps of the values by which a clipped one arrives at the range at once
STUCK = 0.5  # s with the same three values
# A step of the values from which a sensor is coarse: 12 bit have 1 deg/s and 0.08 m/s^2 at the usual largest range, 8 bit of the
# smallest one 2 deg/s and 0.15 m/s^2.
COARSE = {"gyro": 0.024, "accel": 0.11}  # rad/s, m/s^2
# A smaller step shows the noise of every sensor: its values are never the same for long.
FINE = {"gyro": 0.003, "accel": 0.02}  # rad/s, m/s^2
EXTREME = {"gyro": 0.35, "accel": 12.0}  # rad/s, m/s^2: a smaller extreme is no range
NAMES = {"gyro": "the gyroscope", "accel": "the accelerometer"}
OTHER = {"gyro": "accel", "accel": "gyro"}
_ROUNDED = 1e-7  # of a value: a smaller change is rounding


class Values:
    """Values of one sensor, `name`: gyro or accel."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._extreme, self._clipped = np.zeros(3), np.zeros(3)
        self._step = np.full(3, np.inf)  # smallest change of each axis
        self._run = self._stuck = 0.0  # s
        self._low, self._high = np.full(3, np.inf), np.full(3, -np.inf)  # of the other sensor in this run
        self._last: np.ndarray | None = None
        self._same = self._small = self._changed = 0.0

    def forget(self, keep: float) -> None:
        """Multiply all counts by `keep`."""
        self._clipped *= keep
        for name in ("_stuck", "_same", "_small", "_changed"):
            setattr(self, name, keep * getattr(self, name))

    def take(self, block: Block) -> None:
        """Look at a block."""
        values = getattr(block, self._name)
        before = values[:1] if self._last is None else self._last[None]
        change = np.abs(np.diff(np.concatenate([before, values]), axis=0))
        changed = change > _ROUNDED * np.maximum(np.abs(values), 1e-3)
        self._step = np.minimum(self._step, np.min(change, axis=0, where=changed, initial=np.inf))
        self._last = values[-1]
        self._changed += np.count_nonzero(changed)
        self._same += changed.size - np.count_nonzero(changed)
        self._small += np.count_nonzero(changed & (change < COARSE[self._name]))
        self._count_clipped(np.abs(values), change)
        self._follow_runs(block, ~changed.any(axis=1))

    def findings(self) -> list[Finding]:
        """Return what is odd."""
        found, name = [], NAMES[self._name]
        if self._same > 0.005 * (self._same + self._changed) and self._small < 0.1 * min(self._same, self._changed):
            found.append(Finding(f"{self._name}_quantised", f"{name} is coarsely quantised: an orientation follows its steps"))
        elif self._stuck >= STUCK:
            found.append(Finding(f"{self._name}_stuck", f"{name} repeats the same values for up to {self._stuck:.1f} s"))
        clipped = (self._clipped >= CLIPPED) & (self._extreme > EXTREME[self._name])
        if clipped.any() and self._stuck < STUCK:
            axes = ", ".join(axis for axis, yes in zip("xyz", clipped) if yes)
            found.append(Finding(f"{self._name}_clipped", f"{name} is clipped at its range on {axes}: a larger range is needed"))
        return found

    def _count_clipped(self, size: np.ndarray, change: np.ndarray) -> None:
        """Count the samples at the extreme at which the values arrived steeply; both (n, 3)."""
        extreme = size.max(axis=0)
        higher = extreme > self._extreme * (1.0 + 1e-4)
        self._extreme = np.where(higher, extreme, self._extreme)
        self._clipped[higher] = 0.0
        at = size >= self._extreme * (1.0 - 1e-4)
        both = at[1:] & at[:-1]
        for axis in np.flatnonzero(both.any(axis=0)):
            begins = np.flatnonzero(at[:, axis] & ~np.concatenate([[False], at[:-1, axis]]))
            steep = change[begins, axis] > STEEP * self._step[axis]
            of_run = np.searchsorted(begins, np.flatnonzero(both[:, axis]) + 1, side="right") - 1
            self._clipped[axis] += np.count_nonzero(steep[of_run])

    def _follow_runs(self, block: Block, same: np.ndarray) -> None:
        """Find the longest run of repeated values (n,) that is no rest."""
        bounds = np.concatenate([[0], np.flatnonzero(~same), [len(same)]])  # of runs; the first one continues
        lengths = np.diff(bounds)
        last = len(lengths) - 1
        for i in sorted({0, last, *np.flatnonzero(lengths * block.period >= STUCK).tolist()}):
            if i:
                self._run, self._low, self._high = 0.0, np.full(3, np.inf), np.full(3, -np.inf)
            if lengths[i]:
                self._extend_run(block, slice(bounds[i], bounds[i + 1]))

    def _extend_run(self, block: Block, part: slice) -> None:
        other = getattr(block, OTHER[self._name])[part]
        self._run += len(other) * block.period
        low, high = np.quantile(other, (0.1, 0.9), axis=0)  # without spikes
        self._low, self._high = np.minimum(self._low, low), np.maximum(self._high, high)
        if self._run >= STUCK and not self._rests(getattr(block, self._name)[part.start]):
            self._stuck = max(self._stuck, self._run)

    def _rests(self, value: np.ndarray) -> bool:
        """Whether a sensor as coarse as this one repeats a value (3,) at rest, by the other one's extent in the run."""
        if not self._step.min() >= FINE[self._name]:
            return False
        extent = self._high - self._low
        if self._name == "accel":
            return bool(np.abs(np.concatenate([self._low, self._high])).max() <= LARGEST_BIAS)
        # From the lowest to the highest tenth there are 2.6 standard deviations.
        return bool(extent.max() <= 2.6 * QUIET * np.linalg.norm(self._high) and np.abs(value).max() <= 2.0 * self._step.min())
