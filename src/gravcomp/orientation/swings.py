"""How fast the rates of a sensor swing, and so what it likely turned in a gap.

A motion has slow and fast swings. The slow ones are those of the smoothed rate, with the angular frequency f = w' / w, of RMS
values. The fast ones, such as a tremor, show in the second derivative: f = w'' / w' and w = w'^2 / w''. Vibration
(`vibration`) is no swing; of it, only the noise of the rates counts. What that says of a gap is in `missing_rates`.
"""

import math

from gravcomp.orientation.missing_rates import Swing, likeliest_turn
from gravcomp.orientation.quaternion import Vector
from gravcomp.orientation.vibration import Vibration

_MEMORY = 1.0  # s
_SMOOTHING = 0.05  # s, of the rate whose change shows the slow swings
_UNEVEN = 2.0  # the rate need not change evenly in a gap: square of f, of that of an even change


class Swings:
    """Follows the rate (3,) of a sensor, without its bias."""

    def __init__(self) -> None:
        self._noise = Vibration(means=1)
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self._noise.reset()
        self._turning = self._changing = 0.0  # mean squares of w, of the smoothed rate's change: (rad/s)^2, (rad/s^2)^2
        self._change = self._bend = 0.0  # mean squares of w' and w'', (rad/s^2)^2 and (rad/s^3)^2
        self._smooth: Vector = (0.0, 0.0, 0.0)
        self.interrupt()

    def interrupt(self) -> None:
        """Forget the last samples, not how they swing: what follows is no continuation of them."""
        self._noise.interrupt()
        self._last: Vector | None = None
        self._slope: Vector | None = None

    def saved(self) -> tuple:
        """Return the state, for `restore`."""
        squares = self._turning, self._changing, self._change, self._bend
        return *squares, self._smooth, self._last, self._slope, self._noise.saved()

    def restore(self, state: tuple) -> None:
        """Set a saved state."""
        self._turning, self._changing, self._change, self._bend, self._smooth, self._last, self._slope = state[:7]
        self._noise.restore(state[7])

    def watch(self, dt: float, rate: Vector) -> None:
        """Follow the rate (3,) in rad/s over `dt` s."""
        self._noise.take(dt, rate)
        gain = dt / (_MEMORY + dt)
        wx, wy, wz = rate
        sx, sy, sz = self._smooth
        slower = 1.0 / (_SMOOTHING + dt)
        cx, cy, cz = (wx - sx) * slower, (wy - sy) * slower, (wz - sz) * slower
        self._smooth = sx + cx * dt, sy + cy * dt, sz + cz * dt
        self._turning += gain * (wx * wx + wy * wy + wz * wz - self._turning)
        self._changing += gain * (cx * cx + cy * cy + cz * cz - self._changing)
        if self._last is not None:
            lx, ly, lz = self._last
            slope = dx, dy, dz = (wx - lx) / dt, (wy - ly) / dt, (wz - lz) / dt
            self._change += gain * (dx * dx + dy * dy + dz * dz - self._change)
            if self._slope is not None:
                px, py, pz = self._slope
                square = ((dx - px) ** 2 + (dy - py) ** 2 + (dz - pz) ** 2) / (dt * dt)
                self._bend += gain * (square - self._bend)
            self._slope = slope
        self._last = rate

    def noise(self, period: float) -> float:
        """Return the variance of a rate on each axis by vibration, (rad/s)^2, with the period in s between two samples."""
        return self._noise.variance(period)

    def across(self, gap: float, period: float, after: Vector, doubt: float) -> tuple[Vector, float]:
        """Return the likeliest mean rate (3,) in a gap (s), rad/s, and the variance of the angle turned, rad^2 on each axis.

        period: s between two samples; after (3,): the rate after the gap, and doubt: its error beyond noise, rad/s.
        """
        smooth, before = (after, after) if self._last is None else (self._smooth, self._last)
        noise = self.noise(period)
        turning = max(0.0, self._turning - 3.0 * noise)
        changing = max(0.0, self._changing - 3.0 * noise / (_SMOOTHING + period) ** 2)
        # The sensor may have begun to move in the gap.
        most = max(turning, sum(w * w for w in before), sum(w * w for w in after))
        if most <= 0.0:
            return after, 0.0
        swung = _UNEVEN * math.dist(before, after) ** 2 / (gap * gap)
        squares = swung / most, changing / turning if turning > 0.0 else 0.0, 1.0 / _MEMORY**2
        parts = [Swing(most / 3.0, math.sqrt(max(squares)))]  # slower ones do not show in the memory
        change = max(0.0, self._change - 6.0 * noise / period**2)
        bend = max(0.0, self._bend - 18.0 * noise / period**4)
        if change > 0.0 and bend > 0.0:
            parts.append(Swing(change * change / (3.0 * bend), math.sqrt(bend / change)))
        # A rate is the mean of the period before it; smoothed, it is as late as the smoothing is long.
        times = (-_SMOOTHING - 0.5 * period, -0.5 * period, gap - 0.5 * period)
        weights, variance = likeliest_turn(parts, times, (noise, noise, noise + doubt * doubt), gap)
        x, y, z = (sum(w * r for w, r in zip(weights, rates)) / gap for rates in zip(smooth, before, after))
        return (x, y, z), variance
