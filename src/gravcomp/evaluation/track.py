"""A growing record of stamped vectors."""

import numpy as np


class Track:
    """Stamps (s) and values (k,) as they come; `stamps` (n,), `values` (n, k)."""

    def __init__(self, width: int):
        self._width = width
        self._rows: list[tuple] = []

    def add(self, stamp: float, *values: float) -> None:
        self._rows.append((stamp, *values))

    def __len__(self) -> int:
        return len(self._rows)

    @property
    def stamps(self) -> np.ndarray:
        return np.array([row[0] for row in self._rows])

    @property
    def values(self) -> np.ndarray:
        return np.array([row[1:] for row in self._rows]).reshape(len(self._rows), self._width)

    def between(self, begin: float, end: float) -> tuple[np.ndarray, np.ndarray]:
        """Stamps and values with begin <= stamp < end."""
        stamps, values = self.stamps, self.values
        chosen = (stamps >= begin) & (stamps < end) if len(self) else np.zeros(0, bool)
        return stamps[chosen], values[chosen]

    def at(self, stamps: np.ndarray) -> np.ndarray:
        """(len(stamps), k) interpolated linearly; NaN outside the record."""
        if not len(self):
            return np.full((len(stamps), self._width), np.nan)
        own, values = self.stamps, self.values
        order = np.argsort(own, kind="stable")
        columns = [np.interp(stamps, own[order], values[order, i], left=np.nan, right=np.nan) for i in range(self._width)]
        return np.stack(columns, axis=1)
