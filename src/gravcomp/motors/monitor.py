"""Detection of motor faults from feedback and command: stall, runaway, wrong sign.

A condition must last before it counts as a fault, because a gear that breaks away meets all of them for some milliseconds. The
duration is measured between feedback frames, and no interval counts for more than LONGEST_STEP: a condition that was not observed
does not last, and a delayed control loop does not report a fault from old feedback.
"""

from gravcomp.description.hardware import Drive, Watchdog

LONGEST_STEP = 0.01
"""s; largest duration that an interval between two feedback frames counts for."""

_STANDSTILL = 0.0125  # of the velocity limit
_RUNAWAY_TIME = 0.04  # s
_NEAR_LIMIT = 0.95  # of the current limit


class MotorMonitor:
    """Watches one motor."""

    def __init__(self, drive: Drive, watchdog: Watchdog):
        self._drive, self._watchdog = drive, watchdog
        self.reset()

    def reset(self) -> None:
        """Forget all conditions."""
        self._seen: float | None = None
        self._durations: dict[str, float] = {}  # s, of the conditions that are met now

    def update(self, seen: float, current: float, velocity: float, lag: float) -> str | None:
        """Return what is wrong with the motor, or None.

        `seen` (s) is the arrival of the feedback, `current` (A) the commanded one, `velocity` (m/s) the measured one, `lag` (m)
        the setpoint minus the measured displacement.
        """
        self._step = 0.0 if self._seen is None else min(max(seen - self._seen, 0.0), LONGEST_STEP)
        self._seen = seen
        drive, watchdog = self._drive, self._watchdog
        saturated = abs(current) >= _NEAR_LIMIT * drive.current_limit
        if self._lasts("stall", saturated and abs(velocity) < _STANDSTILL * drive.velocity_limit, watchdog.stall_time):
            return f"stalled: {current:.2f} A without motion"
        if self._lasts("lag", abs(lag) > watchdog.following_error, _RUNAWAY_TIME):
            return f"is {1e3 * abs(lag):.1f} mm away from its setpoint"
        if self._lasts("overspeed", abs(velocity) > watchdog.overspeed * drive.velocity_limit, _RUNAWAY_TIME):
            return f"runs away: {1e3 * velocity:.0f} mm/s"
        against = saturated and velocity * current < 0 and abs(velocity) > 0.5 * drive.velocity_limit
        if self._lasts("sign", against, 2 * _RUNAWAY_TIME):
            return "moves against its current: is `direction` right?"
        return None

    def _lasts(self, what: str, condition: bool, duration: float) -> bool:
        if not condition:
            self._durations.pop(what, None)
            return False
        self._durations[what] = self._durations[what] + self._step if what in self._durations else 0.0
        return self._durations[what] >= duration
