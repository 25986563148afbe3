"""An IMU recording as arrays; they are checked once, at construction."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from gravcomp.config import ConfigError

_AT_ONCE = 4096  # samples


class RecordingError(ConfigError):
    """A recording that cannot be read or used; the text names what was found and what is needed."""


@dataclass(frozen=True)
class Recording:
    """An IMU stream and, where known, the ground truth of its orientation; n samples, k temperature readings.

    Samples that are not finite are kept; the filter rejects and reports them.
    """

    source: str  # file or folder
    stamp_ns: np.ndarray  # (n,) int64, ns
    gyro: np.ndarray  # (n, 3) rad/s, sensor frame
    accel: np.ndarray  # (n, 3) m/s^2, specific force, sensor frame
    temperature_stamp_ns: np.ndarray | None = None  # (k,) int64, ns
    temperature: np.ndarray | None = None  # (k,) degC
    orientation: np.ndarray | None = None  # (n, 4) true w x y z, sensor to earth; NaN where unknown
    movement: np.ndarray | None = None  # (n,) bool, samples that count in the evaluation
    notes: tuple[str, ...] = ()  # what was repaired or lost on reading, a sentence each

    def __post_init__(self) -> None:
        count = len(self.stamp_ns)
        if count < 2:
            raise RecordingError(f"{self.source}: has {count} IMU samples; at least 2 are needed")
        for name, width in (("gyro", 3), ("accel", 3), ("orientation", 4)):
            value = getattr(self, name)
            if value is not None and value.shape != (count, width):
                raise RecordingError(f"{self.source}: {name} has the shape {value.shape}; ({count}, {width}) is needed")
        if not (np.diff(self.stamp_ns) > 0).any():
            raise RecordingError(
                f"{self.source}: the stamps do not advance: all {count} are {self.stamp_ns[0]} ns or earlier;"
                " stamps in the order of the samples are needed"
            )
        for name in ("gyro", "accel"):
            if not np.isfinite(getattr(self, name)).all(axis=1).any():
                raise RecordingError(f"{self.source}: {name} has no finite sample among its {count}")
        if self.movement is not None and self.movement.shape != (count,):
            raise RecordingError(f"{self.source}: movement has the shape {self.movement.shape}; ({count},) is needed")

    def __len__(self) -> int:
        return len(self.stamp_ns)

    def samples(self) -> Iterator[tuple[int, list[float], list[float]]]:
        """Yield stamp, rate and specific force of each sample as Python numbers, which are faster one by one than NumPy's.

        They are made some thousands at a time: all at once they would take ten times the memory of the arrays.
        """
        for begin in range(0, len(self), _AT_ONCE):
            part = slice(begin, begin + _AT_ONCE)
            yield from zip(self.stamp_ns[part].tolist(), self.gyro[part].tolist(), self.accel[part].tolist())

    @property
    def duration(self) -> float:
        """Time from the first to the last stamp, s."""
        return float(self.stamp_ns[-1] - self.stamp_ns[0]) * 1e-9

    @property
    def rate(self) -> float:
        """Sample rate in Hz, from the median of the steps by which the stamps advance."""
        step = np.diff(self.stamp_ns)
        return 1e9 / float(np.median(step[step > 0]))

    def between(self, begin: float, end: float) -> "Recording":
        """Return the samples from `begin` to `end`, in s after the first sample; all temperature readings are kept."""
        since = self.stamp_ns - self.stamp_ns[0]
        rows = (since >= round(1e9 * begin)) & (since <= round(1e9 * end))
        arrays = {name: getattr(self, name) for name in ("stamp_ns", "gyro", "accel", "orientation", "movement")}
        return replace(self, **{name: values[rows] for name, values in arrays.items() if values is not None})

    def averaged(self, count: int) -> "Recording":
        """Return the recording at 1/count of its rate: the mean of every `count` samples, with the stamp and truth of the last.

        The truth of the last sample is the orientation to which the samples of the window lead.
        """
        whole = len(self) // count * count
        last = slice(count - 1, whole, count)

        def mean(values: np.ndarray) -> np.ndarray:
            return values[:whole].reshape(-1, count, 3).mean(axis=1)

        return Recording(
            source=self.source,
            stamp_ns=self.stamp_ns[last],
            gyro=mean(self.gyro),
            accel=mean(self.accel),
            temperature_stamp_ns=self.temperature_stamp_ns,
            temperature=self.temperature,
            orientation=None if self.orientation is None else self.orientation[last],
            movement=None if self.movement is None else self.movement[last],
            notes=self.notes,
        )
