"""Stamps of a 32-bit counter that wraps, continued while they come; a recording is continued as a whole by `recordings.imu`."""

from gravcomp.recordings.imu.stamps import wrapped_counter

_SHARE = 0.05  # of a new step in the mean period


class CounterStamps:
    """Continues the stamps of one sender. Attributes: wraps (number so far), passed (ns, of all wraps)."""

    def __init__(self) -> None:
        self.wraps = 0
        self._last: int | None = None
        self._period = 0.0  # ns
        self.passed = 0

    def continued(self, stamp_ns: int) -> int:
        """Return the stamp (ns) without the wraps so far."""
        last, self._last = self._last, stamp_ns
        if last is None:
            return stamp_ns
        step = stamp_ns - last
        if step > 0:
            self._period = step if self._period == 0.0 else self._period + _SHARE * (step - self._period)
        elif step < 0 and self._period > 0.0 and (span := wrapped_counter(step, self._period)):
            self.passed += span
            self.wraps += 1
        return stamp_ns + self.passed
