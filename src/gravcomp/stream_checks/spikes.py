"""Spikes: samples that are local extremes far beyond the usual change from sample to sample."""

import numpy as np

from gravcomp.stream_checks.finding import Block, Finding

RATIO = 3.0  # of the usual change: the median of the changes around; of noise it is 7 standard deviations
AROUND = 15  # changes; so few that vibration which begins within a block is no row of spikes
SHARE = 0.005  # of the samples, from which spikes are a property of the stream


class Spikes:
    """Counts the spikes of both sensors; the units do not matter."""

    def __init__(self) -> None:
        self._count = 0.0
        self._found = {"gyro": 0.0, "accel": 0.0}

    def forget(self, keep: float) -> None:
        """Multiply all counts by `keep`."""
        self._count *= keep
        self._found = {name: keep * count for name, count in self._found.items()}

    def take(self, block: Block) -> None:
        """Count the spikes of a block."""
        self._count += len(block.gyro)
        for name, least in (("gyro", 0.15), ("accel", 0.15 * float(np.median(np.linalg.norm(block.accel, axis=1))))):
            self._found[name] += np.count_nonzero(spikes(getattr(block, name), least))

    def findings(self) -> list[Finding]:
        """Return the sensors whose share of spikes is odd."""
        names = {"gyro": "the gyroscope", "accel": "the accelerometer"}
        return [
            Finding(f"{name}_spikes", f"{names[name]} has spikes in {100 * count / self._count:.1f} % of the samples: held")
            for name, count in self._found.items()
            if self._count and count > SHARE * self._count
        ]


def spikes(values: np.ndarray, least: float) -> np.ndarray:
    """Return which of the values (n, 3) are spikes, (n,) bool; none is smaller than `least`."""
    change = np.diff(values, axis=0)
    into, out = change[:-1], -change[1:]
    peak = np.where(into * out > 0, np.minimum(abs(into), abs(out)), 0.0).max(axis=1)
    around = np.pad(np.abs(change).max(axis=1), AROUND // 2, mode="edge")
    usual = np.median(np.lib.stride_tricks.sliding_window_view(around, AROUND), axis=1)
    return np.concatenate([[False], peak > np.maximum(RATIO * np.maximum(usual[:-1], usual[1:]), least), [False]])
