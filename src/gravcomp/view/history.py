"""What is plotted, of the last seconds and minutes."""

import numpy as np


class History:
    """Rows (time, values...), oldest first; memory is fixed."""

    def __init__(self, columns: int, span: float, rate: float):
        """`span` s are kept, at up to `rate` rows a second."""
        self._kept = int(span * rate * 1.1) + 2
        # Twice as many, so that rows are seldom moved.
        self._rows = np.full((2 * self._kept, columns + 1), np.nan)
        self._count = 0

    def add(self, time: float, values: np.ndarray) -> None:
        """A row; one whose time went back begins anew."""
        if self._count and time < self._rows[self._count - 1, 0]:
            self._count = 0
        if self._count == len(self._rows):
            self._rows[: self._kept] = self._rows[-self._kept :]
            self._count = self._kept
        self._rows[self._count] = np.concatenate([[time], values])
        self._count += 1

    def columns(self, window: float, until: float = np.inf) -> tuple[np.ndarray, ...]:
        """Of the last `window` s before the newest row that is not after `until`: seconds before it (never positive), then each value."""
        rows = self._rows[: np.searchsorted(self._rows[: self._count, 0], until, side="right")]
        if not len(rows):
            return tuple(np.zeros(0) for _ in range(self._rows.shape[1]))
        age = rows[:, 0] - rows[-1, 0]
        shown = age >= -window
        return age[shown], *(rows[shown, i] for i in range(1, rows.shape[1]))
