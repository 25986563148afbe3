"""Delay of a loop that closes over topics, and how soft the loop has to be for it.

The delay is the age of the measured state when an effort answers it, and the time for which this effort stays, until the next one
is sent. It rises at once and falls slowly, so that a single late message counts for a second.

The gains of a drive are those of loops with the delay NOMINAL, as on a CAN bus. A loop stays stable when all its crossovers fall
as its delay D rises: by the softness NOMINAL / D of `loop`.
"""

NOMINAL = 0.006
"""s, delay of the loops that the gains of a drive are for: feedback every 2 ms, and a current for 4 ms."""

_FIRST = 0.03  # s, until the delay has been measured for a while
_FALL_TIME = 0.5  # s, in which the excess over the present delay falls to a third


class LoopDelay:
    """The delay (s) of one loop. least: smallest delay that counts (s), None: NOMINAL."""

    def __init__(self, least: float | None):
        self._least = max(NOMINAL, least or 0.0)
        self.value = max(self._least, _FIRST)
        self._last: float | None = None

    def pause(self) -> None:
        """No effort is sent until the next `update`."""
        self._last = None

    def update(self, now: float, measured: float) -> float:
        """Take an effort that is sent now (s) for a state that was measured at `measured` (s). Return the softness, 0 to 1."""
        elapsed = 0.0 if self._last is None else max(now - self._last, 0.0)
        self._last = now
        present = max(now - measured, 0.0) + elapsed
        fallen = self.value + (present - self.value) * min(elapsed / _FALL_TIME, 1.0)
        self.value = max(present, fallen, self._least)
        return min(1.0, NOMINAL / self.value)
