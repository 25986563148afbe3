"""How fast the rates of a sensor swing, and so by how much it may have turned in a gap other than the rates around it show.

In a gap the mean of the rates around stands in for the missing ones. Of a rate that swings with an angular frequency f and the
RMS w, that misses the share (f t)^2 / 12 of the angle w t in a short gap t, and half of it in a long one. A motion has slow and
fast swings. The slow ones are those of the smoothed rate, with f = w' / w. The fast ones, such as a tremor, show in the second
derivative: f = w'' / w' and w = w'^2 / w''. Vibration (`vibration`) is no swing; of it, only the noise of the two rates counts.
"""

import math

from gravcomp.orientation.quaternion import Vector
from gravcomp.orientation.vibration import Vibration

_MEMORY = 1.0  # s
_SMOOTHING = 0.05  # s, of the rate whose change shows the slow swings


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

    def missed_in(self, gap: float, period: float, *around: float) -> float:
        """Return by how much (rad) the sensor may have turned in a gap (s) other than the rates around it (rad/s) show.

        period: s between two samples.
        """
        noise = 3.0 * self.noise(period)
        turning = max(0.0, self._turning - noise)
        changing = max(0.0, self._changing - noise / (_SMOOTHING + period) ** 2)
        change = max(0.0, self._change - 2.0 * noise / period**2)
        bend = max(0.0, self._bend - 6.0 * noise / period**4)
        slow = _missed(gap * gap * changing, turning, gap * max(math.sqrt(turning), *around))
        fast = _missed(gap * gap * bend, change, gap * change / math.sqrt(bend)) if bend > 0.0 else 0.0
        return math.hypot(slow, fast)


def _missed(swing: float, of: float, angle: float) -> float:
    """Return the part of an angle that a gap t hides, (f t)^2 / 12 and at most half, with (f t)^2 = swing / of."""
    return angle * (swing / (12.0 * of) if swing < 6.0 * of else 0.5)
