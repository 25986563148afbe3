"""Record of stamped vectors that grows during a run."""

import numpy as np


class Track:
    """n stamps (s) with values (k,), in the order of their arrival."""

    def __init__(self, width: int):
        self._width = width
        self._rows: list[tuple] = []

    def add(self, stamp: float, *values: float) -> None:
        """Add the values (k,) at a stamp (s)."""
        self._rows.append((stamp, *values))

    def __len__(self) -> int:
        return len(self._rows)

    @property
    def stamps(self) -> np.ndarray:
        """Stamps (n,) in s."""
        return np.array([row[0] for row in self._rows])

    @property
    def values(self) -> np.ndarray:
        """Values (n, k)."""
        return np.array([row[1:] for row in self._rows]).reshape(len(self._rows), self._width)

    def between(self, begin: float, end: float) -> tuple[np.ndarray, np.ndarray]:
        """Return stamps and values with begin <= stamp < end."""
        stamps, values = self.stamps, self.values
        chosen = (stamps >= begin) & (stamps < end) if len(self) else np.zeros(0, bool)
        return stamps[chosen], values[chosen]

    def at(self, stamps: np.ndarray) -> np.ndarray:
        """Return the values (len(stamps), k), interpolated linearly; NaN outside the record."""
        if not len(self):
            return np.full((len(stamps), self._width), np.nan)
        own, values = self.stamps, self.values
        order = np.argsort(own, kind="stable")
        columns = [np.interp(stamps, own[order], values[order, i], left=np.nan, right=np.nan) for i in range(self._width)]
        return np.stack(columns, axis=1)
