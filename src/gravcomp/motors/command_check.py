"""Checks of a cable command before the bridge follows it."""

import math
from collections.abc import Callable, Sequence

from gravcomp.description.hardware import Watchdog
from gravcomp.description.motor import CableMotor
from gravcomp.description.transmission import Transmission

_MARGIN = 0.01  # of the largest jump: so far beyond a displacement limit is taken as rounding
_LEAST_AGE = -0.1  # s; clocks of two processes may differ by this


class CommandCheck:
    """Checks commands one after another; remembers the last one to find jumps."""

    def __init__(
        self,
        cables: Sequence[str],
        motors: Sequence[CableMotor],
        transmission: Transmission,
        limits: Callable[[], Sequence[tuple[float, float]]],
        watchdog: Watchdog,
    ):
        """cables (m): names; motors (k) with their transmission; limits (k,): smallest and largest displacement (m) now."""
        self._cables, self._transmission, self._limits, self._watchdog = tuple(cables), transmission, limits, watchdog
        self._labels = self._cables if transmission.direct else tuple(motor.label for motor in motors)
        self._last: list[float] | None = None
        self._last_time = -math.inf

    def objection(self, displacement: Sequence[float], tension: Sequence[float], now: float, age: float) -> str | None:
        """Return why the command must not be followed, or None.

        Checked in this order: number of values, finite values, displacements that shared motors can make, displacement
        limits of the motors, age of the IMU sample, jump.
        `displacement` in m, `tension` in N (may be empty), `now` and `age` in s.
        """
        n, watchdog = len(self._cables), self._watchdog
        if len(displacement) != n or len(tension) not in (0, n):
            return f"{len(displacement)} displacements and {len(tension)} tensions for {n} cables"
        if not all(map(math.isfinite, displacement)) or not all(map(math.isfinite, tension)):
            return "it contains a value that is not a number"
        turned, margin = self._transmission.motors(displacement), _MARGIN * watchdog.command_jump
        for name, wanted, possible in zip(self._cables, displacement, self._transmission.cables(turned)):
            if abs(wanted - possible) > margin:
                return (
                    f"{name} to {1e3 * wanted:.2f} mm; with the cables that its motor moves as well, {1e3 * possible:.2f} mm"
                    " is possible"
                )
        for label, x, (low, high) in zip(self._labels, turned, self._limits()):
            if not low - margin <= x <= high + margin:
                return f"{label} to {1e3 * x:.2f} mm; allowed: {1e3 * low:g} to {1e3 * high:g} mm"
        if not _LEAST_AGE <= age <= watchdog.command_timeout:
            return f"its IMU sample is older than {1e3 * watchdog.command_timeout:.0f} ms or in the future"
        last, last_time = self._last, self._last_time
        self._last, self._last_time = list(displacement), now
        if last is not None and now - last_time < watchdog.command_timeout:
            jump = max(abs(x - y) for x, y in zip(displacement, last))
            if jump > watchdog.command_jump:
                return f"it jumps by {1e3 * jump:.1f} mm; allowed: {1e3 * watchdog.command_jump:g} mm"
        return None
