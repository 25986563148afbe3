"""Recent values for the plots."""

import numpy as np


class History:
    """Rows (time, values...) in order of time, in a fixed amount of memory."""

    def __init__(self, columns: int, span: float, rate: float) -> None:
        """Keep `span` s at up to `rate` rows per second."""
        self._kept = int(span * rate * 1.1) + 2
        # Twice as many rows, so that they are moved rarely.
        self._rows = np.full((2 * self._kept, columns + 1), np.nan)
        self._count = 0

    def add(self, time: float, values: np.ndarray) -> None:
        """Add a row. A time before the last one clears the history first."""
        if self._count and time < self._rows[self._count - 1, 0]:
            self._count = 0
        if self._count == len(self._rows):
            self._rows[: self._kept] = self._rows[-self._kept :]
            self._count = self._kept
        self._rows[self._count] = np.concatenate([[time], values])
        self._count += 1

    def columns(self, window: float, until: float = np.inf) -> tuple[np.ndarray, ...]:
        """Return the columns of the last `window` s up to the newest row that is not after `until`.

        The first column is the time relative to this row (s, not positive), then follows each value.
        """
        rows = self._rows[: np.searchsorted(self._rows[: self._count, 0], until, side="right")]
        if not len(rows):
            return tuple(np.zeros(0) for _ in range(self._rows.shape[1]))
        age = rows[:, 0] - rows[-1, 0]
        shown = age >= -window
        return age[shown], *(rows[shown, i] for i in range(1, rows.shape[1]))
