"""Steps of time of a sensor that samples evenly by its own clock, from stamps that jitter because somebody else writes them.

Where the stamps hardly jitter they count as they are. Where they do, a sample counts for the mean period and a part of the time
by which the stamps are ahead (a phase-locked loop of the first order), so that the time counted never leaves that of the stamps
by more than about half a period.
"""

JITTER = 0.1  # RMS of the steps, of the period, from which they are evened
_SHARE = 0.02  # of a new step in the means
_GAIN = 0.1  # of the time by which the stamps are ahead
_NEXT = 1.75  # periods: in a longer step samples are missing
_OFF = 0.5  # periods by which the time counted may be ahead of the stamps, as after a gap that was taken for the period
_LEAST = 0.1  # of a step counts in any case


class EvenSteps:
    """Takes the steps of the stamps one by one."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Start with a new stream."""
        self._period = self._jitter = 0.0
        self._ahead = 0.0  # s, of the stamps that is not counted yet

    def take(self, dt: float) -> float:
        """Return the step in s that counts for one of `dt` s between two stamps."""
        if dt <= 0.0:
            return dt
        period = self._period
        if not period:
            self._period = dt
            return dt
        if dt <= _NEXT * period:
            self._period = period + _SHARE * (dt - period)
            self._jitter += _SHARE * ((dt / period - 1.0) ** 2 - self._jitter)
        waiting = self._ahead + dt
        if self._jitter <= JITTER**2:
            step = waiting if waiting > 0.0 else dt
        else:
            even = max(1, round(waiting / period)) * period
            step = min(even + _GAIN * (waiting - even), max(waiting + _OFF * period, _LEAST * dt))
        self._ahead = waiting - step
        return step
