"""Inclination after missing samples in motion, from the velocity since then.

One specific force in motion says little about the vertical, and the filter's linear correction takes long to turn an orientation
that is wrong by a right angle. The integral of the specific force, turned back by the rates, is a velocity that grows along the
vertical by g per second, plus that of the motion, which is bounded for a sensor that stays near one place. So the straight line
that fits this integral best shows the vertical, however wrong the start was; how far the integral is from it shows how sure that
is.
"""

import math
from collections.abc import Sequence

from gravcomp.orientation import quaternion as quat

LONGEST = 5.0  # s; then the filter corrects
SURE = math.radians(2.0)  # at this standard deviation, too
START_STD = math.radians(5.0)  # of one specific force at rest
LARGEST_STD = math.radians(90.0)  # nothing is known
LOST = math.radians(10.0)  # of a bridged gap: more is not bridged
TOGETHER = math.sqrt(0.75)  # correlation between the slope of a line that fits evenly spread errors and its value at the end
_SWING = 0.3  # s, about the time that a motion goes in one direction
_MEMORY = 1.0  # s, of the motion before the gap
_SMOOTHING = 0.05  # s, of the rates whose change is measured: noise and vibration change rates, but hardly turn the sensor


class Alignment:
    """Follows the motion, and after `begin` the velocity. All vectors (3,) are in the sensor's frame of the newest sample."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self.active = False
        self._turning = self._changing = 0.0  # mean squares of the rate and of its change, (rad/s)^2 and (rad/s^2)^2
        self._shaken = 0.0  # mean square of the specific force's length beyond g, of g
        self._smooth = (0.0, 0.0, 0.0)  # rate, rad/s
        self._elapsed = 0.0  # t
        self._velocity = self._sum = self._moment = (0.0, 0.0, 0.0)  # v; the integrals of v dt and of t v dt
        self._square = 0.0  # integral of v^2 dt

    def saved(self) -> tuple:
        """Return the state, for `restore`."""
        moving = self.active, self._turning, self._changing, self._shaken, self._smooth, self._elapsed
        return *moving, self._velocity, self._sum, self._moment, self._square

    def restore(self, state: tuple) -> None:
        """Set a saved state."""
        self.active, self._turning, self._changing, self._shaken, self._smooth, self._elapsed = state[:6]
        self._velocity, self._sum, self._moment, self._square = state[6:]

    def lost_in(self, gap: float, *around: float) -> bool:
        """Whether the sensor may have turned by more than LOST, other than the rates around it (rad/s) show, in a gap (s).

        Of a rate that swings with an angular frequency f the mean of both ends misses (f gap)^2 / 12 in a short gap.
        """
        swings = gap * gap * self._changing
        share = swings / (12.0 * self._turning) if swings < 6.0 * self._turning else 0.5
        return share * gap * max(math.sqrt(self._turning), *around) > LOST

    def watch(self, dt: float, rate: Sequence[float], force: Sequence[float], gravity: float) -> None:
        """Follow the motion over `dt` s: rate (3,) in rad/s without bias, specific force (3,) in m/s^2."""
        gain = dt / (_MEMORY + dt)
        wx, wy, wz = rate
        sx, sy, sz = self._smooth
        slower = 1.0 / (_SMOOTHING + dt)
        cx, cy, cz = (wx - sx) * slower, (wy - sy) * slower, (wz - sz) * slower
        self._smooth = sx + cx * dt, sy + cy * dt, sz + cz * dt
        self._turning += gain * (wx * wx + wy * wy + wz * wz - self._turning)
        self._changing += gain * (cx * cx + cy * cy + cz * cz - self._changing)
        self._shaken += gain * ((math.hypot(*force) / gravity - 1.0) ** 2 - self._shaken)

    def begin(self, force: Sequence[float], gravity: float) -> None:
        """Begin with the first specific force (3,) after a gap, as `watch`."""
        self._shaken = max(self._shaken, (math.hypot(*force) / gravity - 1.0) ** 2)
        self.active, self._elapsed, self._square = True, 0.0, 0.0
        self._velocity = self._sum = self._moment = (0.0, 0.0, 0.0)

    def take(self, dt: float, rate: quat.Vector, force: quat.Vector, gravity: float) -> quat.Vector:
        """Take a sample `dt` s after the last one, as `watch`; return a vector (3,) that points up, m/s^2."""
        wx, wy, wz = rate
        turn = quat.exponential(-wx * dt, -wy * dt, -wz * dt)
        middle = self._elapsed + 0.5 * dt
        vx, vy, vz = quat.rotate(turn, self._velocity)
        fx, fy, fz = force
        self._velocity = vx + fx * dt, vy + fy * dt, vz + fz * dt
        mx, my, mz = vx + 0.5 * fx * dt, vy + 0.5 * fy * dt, vz + 0.5 * fz * dt
        x, y, z = quat.rotate(turn, self._sum)
        self._sum = x + mx * dt, y + my * dt, z + mz * dt
        x, y, z = quat.rotate(turn, self._moment)
        self._moment = x + middle * mx * dt, y + middle * my * dt, z + middle * mz * dt
        self._square += dt * (mx * mx + my * my + mz * mz)
        self._elapsed += dt
        self.active = self._elapsed < LONGEST and self.std(gravity) > SURE
        # Within a swing of the motion the mean is surer than the slope.
        share = min(max(0.5 * (self._elapsed / _SWING - 1.0), 0.0), 1.0)
        x, y, z = (share * s + (1.0 - share) * v / self._elapsed for s, v in zip(self._slope(), self._velocity))
        return x, y, z

    def _slope(self) -> quat.Vector:
        """Return the slope (3,) of the line that fits the velocity best, m/s^2."""
        t = self._elapsed
        x, y, z = (12.0 * (b - 0.5 * t * a) / t**3 for a, b in zip(self._sum, self._moment))
        return x, y, z

    def motion(self, gravity: float) -> tuple[quat.Vector, float]:
        """Return the newest velocity (3,) beyond the line, and its standard deviation on each axis; m/s.

        Its error is that of the line at its end, which the error of the slope explains but for the share that TOGETHER leaves.
        """
        t = self._elapsed
        x, y, z = (v - a / t - 0.5 * t * s for v, a, s in zip(self._velocity, self._sum, self._slope()))
        return (x, y, z), self.std(gravity) * gravity * t / math.sqrt(3.0)

    def _scatter(self) -> float:
        """Return the mean square of the velocity's distance from the line, (m/s)^2."""
        t = self._elapsed
        slope, total = (sum(a * a for a in values) for values in (self._slope(), self._sum))
        return max(0.0, self._square / t - total / t**2 - slope * t * t / 12.0)

    def std(self, gravity: float) -> float:
        """Return the standard deviation of the inclination about each horizontal axis, rad."""
        t, at_rest = self._elapsed, math.hypot(START_STD, math.sqrt(self._shaken))
        if not t:
            return min(at_rest, LARGEST_STD)
        before = self._shaken * (_SWING * gravity) ** 2 * _SWING / (_SWING + t)
        by_motion = math.sqrt(12.0 * (self._scatter() + before) / (1.0 + t / _SWING)) / (gravity * t)
        return min(max(by_motion, START_STD * _SWING / t if t > _SWING else at_rest), LARGEST_STD)
