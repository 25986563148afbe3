"""Inclination after missing samples in motion, from the velocity since then.

One specific force in motion says little about the vertical, and the filter's linear correction takes long to turn an orientation
that is wrong by a right angle. The integral of the specific force, turned back by the rates, is a velocity that grows along the
vertical by g per second, plus that of the motion, which is bounded for a sensor that stays near one place. So the straight line
that fits this integral best shows the vertical, however wrong the start was; how far the integral is from it shows how sure that
is. A motion that is slower than the time since the start looks like a part of that line. Its share shows in the time scale of
what is left: as long as that is as slow as it can be within this time, more of the same is in the line.

After a gap that the filter bridges the line does not lead: the filter corrects, and the line says how much the velocity shows.
"""

import math
from collections.abc import Sequence

from gravcomp.orientation import quaternion as quat

LONGEST = 10.0  # s; then the filter corrects
SURE = math.radians(1.0)  # at this standard deviation, too
START_STD = math.radians(5.0)  # of one specific force at rest
LARGEST_STD = math.radians(90.0)  # nothing is known
TOGETHER = math.sqrt(0.75)  # correlation between the slope of a line that fits evenly spread errors and its value at the end
_SWING = 0.3  # s, about the time that a motion goes in one direction
_MEMORY = 1.0  # s, of the motion before the gap
_SMOOTHING = 0.05  # s, of the specific force: noise hardly moves the sensor

# Half a period of a sinusoid is pi v / a, with the RMS of its velocity and acceleration. What a line leaves of one that is slower
# than a period in the time t has 0.4 t, however slow it is, because its low frequencies are in the line.
_SLOWEST = 0.4
# RMS of the acceleration that is in the line, of the one that is left, for such a motion: 1.7 at a third of a period, 1.1 at
# half, 0.7 at two thirds, 0.3 at one.
_HIDDEN = 1.5


class Alignment:
    """Follows the motion, and after `begin` the velocity. All vectors (3,) are in the sensor's frame of the newest sample."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self.active = False
        self.leads = True  # while active: the line gives the inclination
        self._shaken = 0.0  # mean square of the specific force's length beyond g, of g
        self._elapsed = 0.0  # t
        self._velocity = self._sum = self._moment = (0.0, 0.0, 0.0)  # v; the integrals of v dt and of t v dt
        self._square = 0.0  # integral of v^2 dt
        self._force = (0.0, 0.0, 0.0)  # smoothed specific force, m/s^2
        self._force_square = 0.0  # integral of its square
        self._unsure = 0.0  # variance of v by samples without specific force, (m/s)^2

    def saved(self) -> tuple:
        """Return the state, for `restore`."""
        moving = self.active, self.leads, self._shaken, self._elapsed
        line = self._velocity, self._sum, self._moment, self._square
        return *moving, *line, self._force, self._force_square, self._unsure

    def restore(self, state: tuple) -> None:
        """Set a saved state."""
        self.active, self.leads, self._shaken, self._elapsed = state[:4]
        self._velocity, self._sum, self._moment, self._square = state[4:8]
        self._force, self._force_square, self._unsure = state[8:]

    def watch(self, dt: float, force: Sequence[float], gravity: float) -> None:
        """Follow the motion over `dt` s: specific force (3,) in m/s^2."""
        self._shaken += dt / (_MEMORY + dt) * ((math.hypot(*force) / gravity - 1.0) ** 2 - self._shaken)

    def begin(self, force: Sequence[float], gravity: float, leads: bool) -> None:
        """Begin with the first specific force (3,) after a gap, as `watch`. leads: the line gives the inclination."""
        self.leads = leads
        self._shaken = max(self._shaken, (math.hypot(*force) / gravity - 1.0) ** 2)
        self.active, self._elapsed, self._square = True, 0.0, 0.0
        self._force = (float(force[0]), float(force[1]), float(force[2]))
        self._force_square = self._unsure = 0.0
        self._velocity = self._sum = self._moment = (0.0, 0.0, 0.0)

    def take(self, dt: float, rate: quat.Vector, force: quat.Vector, gravity: float, noise: float = 0.0) -> quat.Vector:
        """Take a sample `dt` s after the last one; return a vector (3,) that points up, m/s^2.

        rate (3,) in rad/s without bias; force (3,) in m/s^2; noise: of the force, m/s^2/sqrt(Hz), by vibration, or where it
        cannot be measured and `force` is the likeliest one.
        """
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
        x, y, z = quat.rotate(turn, self._force)
        gain = dt / (_SMOOTHING + dt)
        self._force = x + gain * (fx - x), y + gain * (fy - y), z + gain * (fz - z)
        self._force_square += dt * sum(f * f for f in self._force)
        self._unsure += noise * noise * dt
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

    def velocity_noise(self, gravity: float) -> float:
        """Return the density of a velocity about zero, m/s sqrt(s), that shows the inclination as surely as the line does.

        The line that fits white noise of this density d best over the time t has a slope with the variance 12 d^2 / t^3.
        """
        return self.std(gravity) * gravity * math.sqrt(self._elapsed**3 / 12.0)

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
        scatter = self._scatter()
        before = self._shaken * (_SWING * gravity) ** 2 * _SWING / (_SWING + t)
        resolved = 12.0 * (scatter + before) / (1.0 + t / _SWING)
        # A step of v by d turns the slope by 1.5 d / t at most.
        variance = resolved + 2.25 * self._unsure + (t * self._hidden(scatter)) ** 2
        return min(max(math.sqrt(variance) / (gravity * t), START_STD * _SWING / t if t > _SWING else at_rest), LARGEST_STD)

    def _hidden(self, scatter: float) -> float:
        """Return the RMS on each axis of the acceleration that is too slow to be left by the line, m/s^2."""
        t = self._elapsed
        left = self._force_square / t - sum(v * v for v in self._velocity) / t**2
        if left <= 0.0:
            return 0.0
        slow = min(math.pi * math.sqrt(scatter / left) / (_SLOWEST * t), 1.0)
        return _HIDDEN * slow * slow * math.sqrt(left / 3.0)
