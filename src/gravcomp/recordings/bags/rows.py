"""The messages of one topic of a bag as columns, while they are read."""

from array import array

import numpy as np


class Rows:
    """Stamp, time of reception and values of each message, in 8 bytes each: a long recording has millions."""

    def __init__(self, width: int | None = None) -> None:
        """width: number of values of a message; None: that of the first one."""
        self._stamps, self._receptions, self._values = array("q"), array("q"), array("d")
        self._widths = set() if width is None else {width}

    def __len__(self) -> int:
        return len(self._stamps)

    @property
    def even(self) -> bool:
        """Whether all messages have the same number of values."""
        return len(self._widths) <= 1

    def append(self, stamp: int, received: int, values: tuple[float, ...]) -> None:
        """Add a message: stamp and time of reception in ns, values (n,)."""
        self._stamps.append(stamp)
        self._receptions.append(received)
        self._values.extend(values)
        self._widths.add(len(values))

    def arrays(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return stamps (k,) and times of reception (k,) in ns, and values (k, n). Raises ValueError where they are not even."""
        if not self.even:
            raise ValueError(f"messages have {', '.join(map(str, sorted(self._widths)))} values; the same number is needed")
        stamps, receptions = (np.frombuffer(times, dtype=np.int64) for times in (self._stamps, self._receptions))
        return stamps, receptions, np.frombuffer(self._values).reshape(len(self), next(iter(self._widths), 0))


def stamp_ns(message: object) -> int:
    """Return the stamp of a message's header in ns."""
    stamp = message.header.stamp  # type: ignore[attr-defined]
    return stamp.sec * 1_000_000_000 + stamp.nanosec
