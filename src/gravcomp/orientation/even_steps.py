"""Steps of time of a sensor that samples evenly by its own clock, from stamps that jitter because somebody else writes them.

Where the stamps hardly jitter they count as they are. Where they do, a sample counts for the mean period and a part of the time
by which the stamps are ahead (a phase-locked loop of the first order). The time counted never leaves that of the stamps by more
than about half a period, also where the rate changes.
"""

JITTER = 0.1  # RMS of the steps, of the period, from which they are evened
_SHARE = 0.02  # of a new step in the means
_GAIN = 0.1  # of the time by which the stamps are ahead
_NEXT = 1.75  # periods: in a longer step samples are missing
_WRONG = 0.5  # share of longer steps from which the period is wrong: the first step was short, or the rate has changed
_FARTHEST = 0.5  # periods that the time counted may leave that of the stamps


class EvenSteps:
    """Takes the steps of the stamps one by one."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Start with a new stream."""
        self._period = self._jitter = self._longer = 0.0
        self._ahead = 0.0  # s, of the stamps that is not counted yet

    def take(self, dt: float) -> float:
        """Return the step in s that counts for one of `dt` s between two stamps."""
        if dt <= 0.0:
            return dt
        period = self._period
        if not period:
            self._period = dt
            return dt
        self._longer += _SHARE * ((dt > _NEXT * period) - self._longer)
        if self._longer > _WRONG:
            self._period, self._jitter, self._longer = dt, 0.0, 0.0
        elif dt <= _NEXT * period:
            self._period = period + _SHARE * (dt - period)
            self._jitter += _SHARE * ((dt / period - 1.0) ** 2 - self._jitter)
        waiting = self._ahead + dt
        if self._jitter <= JITTER**2:
            step = waiting if waiting > 0.0 else dt
        else:
            even = max(1, round(waiting / period)) * period
            step = even + _GAIN * (waiting - even)
            step = min(max(step, waiting - _FARTHEST * period), waiting + _FARTHEST * period)
            step = step if step > 0.0 else dt
        self._ahead = waiting - step
        return step
