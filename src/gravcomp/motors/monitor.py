"""Faults of one motor that its own numbers tell: stall, runaway, a wrong sign.

A condition must last before it counts: a gear that breaks away passes through all of them for some milliseconds. It lasts in
the time of the motor's feedback, of which no pause counts for more than LONGEST_STEP: what nobody saw does not last, and a
control that came late judges no motor by what it saw before.
"""

from gravcomp.description.hardware import Drive, Watchdog

LONGEST_STEP = 0.01
"""s"""

_STANDSTILL = 0.0005  # m/s
_RUNAWAY_TIME = 0.04  # s
_NEAR_LIMIT = 0.95  # of the current limit


class MotorMonitor:
    """Watches one motor; `update` returns what is wrong, or None."""

    def __init__(self, drive: Drive, watchdog: Watchdog):
        self._drive, self._watchdog = drive, watchdog
        self.reset()

    def reset(self) -> None:
        self._seen: float | None = None
        self._lasted: dict[str, float | None] = dict.fromkeys(("stall", "lag", "overspeed", "sign"))

    def update(self, seen: float, current: float, velocity: float, lag: float) -> str | None:
        """`seen` (s): when the feedback came; `current` (A) as commanded, `velocity` (m/s) measured, `lag` (m) setpoint minus
        measured displacement.
        """
        self._step = 0.0 if self._seen is None else min(max(seen - self._seen, 0.0), LONGEST_STEP)
        self._seen = seen
        drive, watchdog = self._drive, self._watchdog
        saturated = abs(current) >= _NEAR_LIMIT * drive.current_limit
        if self._lasts("stall", saturated and abs(velocity) < _STANDSTILL, watchdog.stall_time):
            return f"stalled: {current:.2f} A without motion"
        if self._lasts("lag", abs(lag) > watchdog.following_error, _RUNAWAY_TIME):
            return f"is {1e3 * abs(lag):.1f} mm away from where it shall be"
        if self._lasts("overspeed", abs(velocity) > watchdog.overspeed * drive.velocity_limit, _RUNAWAY_TIME):
            return f"runs away: {1e3 * velocity:.0f} mm/s"
        against = saturated and velocity * current < 0 and abs(velocity) > 0.5 * drive.velocity_limit
        if self._lasts("sign", against, 2 * _RUNAWAY_TIME):
            return "moves against its current: is `direction` right?"
        return None

    def _lasts(self, what: str, condition: bool, duration: float) -> bool:
        if not condition:
            self._lasted[what] = None
            return False
        self._lasted[what] = 0.0 if self._lasted[what] is None else self._lasted[what] + self._step
        return self._lasted[what] >= duration
