"""Inclination after missing samples in motion, from the velocity since then.

One specific force in motion says little about the vertical, and the filter's linear correction takes long to turn an orientation
that is wrong by a right angle. The integral of the specific force, turned back by the rates, is a velocity that grows along the
vertical by g per second, plus that of the motion, which is bounded for a sensor that stays near one place. So the straight line
that fits this integral best shows the vertical, however wrong the start was; how far the integral is from it shows how sure that
is. A motion that is slower than the time since the start looks like a part of that line. Its share shows in the time scale of
what is left: as long as that is as slow as it can be within this time, more of the same is in the line.

After a gap the inclination from before it counts as well, by its variance: it is turned on by the rates across the gap and since
then. Once it is less sure than `LEAST_SURE`, it says no more than the line, and the inclination is that of a start.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from gravcomp.orientation import quaternion as quat

LONGEST = 10.0  # s; then the filter corrects
SURE = math.radians(1.0)  # at this standard deviation, too
START_STD = math.radians(5.0)  # of one specific force at rest
LARGEST_STD = math.radians(90.0)  # nothing is known
LEAST_SURE = math.radians(15.0)  # standard deviation of an earlier inclination that tells nothing
# s: the line is surer than its standard deviation says, which is that of the slowest motion, and more so with each second.
_TRUSTED = 2.0
SWING = 0.3  # s, about the time that a motion goes in one direction: no line goes on over a longer gap
_MEMORY = 1.0  # s, of the motion before the gap
_SMOOTHING = 0.05  # s, of the specific force: noise hardly moves the sensor

# Half a period of a sinusoid is pi v / a, with the RMS of its velocity and acceleration. What a line leaves of one that is slower
# than a period in the time t has 0.4 t, however slow it is, because its low frequencies are in the line.
_SLOWEST = 0.4
# RMS of the acceleration that is in the line, of the one that is left, for such a motion: 1.7 at a third of a period, 1.1 at
# half, 0.7 at two thirds, 0.3 at one.
_HIDDEN = 1.5


@dataclass(frozen=True, slots=True)
class Earlier:
    """The inclination from before a gap, at its end."""

    upward: quat.Vector  # (3,) unit vector that points up, in the sensor's frame
    variance: float  # rad^2 about each horizontal axis
    bias_variance: float  # (rad/s)^2 on each axis, of the gyroscope


class Alignment:
    """Follows the motion, and after `begin` the velocity. All vectors (3,) are in the sensor's frame of the newest sample."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self.active = False
        self._shaken = 0.0  # mean square of the specific force's length beyond g, of g
        self._elapsed = 0.0  # t
        self._velocity = self._sum = self._moment = (0.0, 0.0, 0.0)  # v; the integrals of v dt and of t v dt
        self._square = 0.0  # integral of v^2 dt
        self._line = (0.0, 0.0, 1.0)  # points up, as the line says
        self._earlier = (0.0, 0.0, 1.0)  # points up, as the inclination from before the gap says
        self._earlier_variance, self._bias_variance = math.inf, 0.0
        self._force = (0.0, 0.0, 0.0)  # smoothed specific force, m/s^2
        self._force_square = 0.0  # integral of its square
        self._unsure = 0.0  # variance of v by samples without specific force, (m/s)^2

    def saved(self) -> tuple:
        """Return the state, for `restore`."""
        moving = self.active, self._shaken, self._elapsed
        line = self._velocity, self._sum, self._moment, self._square, self._line
        earlier = self._earlier, self._earlier_variance, self._bias_variance
        return *moving, *line, *earlier, self._force, self._force_square, self._unsure

    def restore(self, state: tuple) -> None:
        """Set a saved state."""
        self.active, self._shaken, self._elapsed = state[:3]
        self._velocity, self._sum, self._moment, self._square, self._line = state[3:8]
        self._earlier, self._earlier_variance, self._bias_variance = state[8:11]
        self._force, self._force_square, self._unsure = state[11:]

    def watch(self, dt: float, force: Sequence[float], gravity: float) -> None:
        """Follow the motion over `dt` s: specific force (3,) in m/s^2."""
        self._shaken += dt / (_MEMORY + dt) * ((math.hypot(*force) / gravity - 1.0) ** 2 - self._shaken)

    def begin(self, force: Sequence[float], gravity: float, earlier: Earlier | None = None) -> None:
        """Begin with the first specific force (3,), as `watch`; earlier: the inclination from before a gap."""
        self._shaken = max(self._shaken, (math.hypot(*force) / gravity - 1.0) ** 2)
        self.active, self._elapsed, self._square = True, 0.0, 0.0
        self._force = (float(force[0]), float(force[1]), float(force[2]))
        self._force_square = self._unsure = 0.0
        self._velocity = self._sum = self._moment = (0.0, 0.0, 0.0)
        self._line, self._earlier_variance = _unit(self._force), math.inf
        if earlier is not None:
            self._earlier, self._earlier_variance, self._bias_variance = earlier.upward, earlier.variance, earlier.bias_variance

    def take(
        self, dt: float, rate: quat.Vector, force: quat.Vector, gravity: float, noise: float = 0.0, turned: float = 0.0
    ) -> None:
        """Take a sample `dt` s after the last one.

        rate (3,) in rad/s without bias; force (3,) in m/s^2; noise: of the force, m/s^2/sqrt(Hz), by vibration, or where it
        cannot be measured and `force` is the likeliest one; turned: variance of the turn by the rate, rad^2 on each axis.
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
        self._earlier = quat.rotate(turn, self._earlier)
        self._earlier_variance += turned + self._bias_variance * dt * (2.0 * self._elapsed + dt)
        self._elapsed += dt
        self.active = self._elapsed < LONGEST and self.std(gravity) > SURE
        # Within a swing of the motion the mean is surer than the slope.
        share = min(max(0.5 * (self._elapsed / SWING - 1.0), 0.0), 1.0)
        x, y, z = (share * s + (1.0 - share) * v / self._elapsed for s, v in zip(self._slope(), self._velocity))
        self._line = _unit((x, y, z))

    def inclination(self, gravity: float) -> tuple[quat.Vector, float]:
        """Return a vector (3,) that points up, and its standard deviation about each horizontal axis, rad."""
        share, variance = self._share(self.std(gravity))
        x, y, z = (share * e + (1.0 - share) * a for e, a in zip(self._earlier, self._line))
        return (x, y, z), math.sqrt(variance)

    def _share(self, std: float) -> tuple[float, float]:
        """Return the share of the earlier inclination, for a line with this standard deviation, rad; and the variance, rad^2."""
        sure = max(1.0 / self._earlier_variance - 1.0 / LEAST_SURE**2, 0.0)
        if not sure:
            return 0.0, std * std
        share = sure / (sure + ((1.0 + (self._elapsed / _TRUSTED) ** 2) / std) ** 2)
        return share, share * share * self._earlier_variance + ((1.0 - share) * std) ** 2

    def _slope(self) -> quat.Vector:
        """Return the slope (3,) of the line that fits the velocity best, m/s^2."""
        t = self._elapsed
        x, y, z = (12.0 * (b - 0.5 * t * a) / t**3 for a, b in zip(self._sum, self._moment))
        return x, y, z

    def motion(self, gravity: float) -> tuple[quat.Vector, float, float]:
        """Return the newest velocity (3,) beyond the line along the inclination, m/s, its standard deviation and a correlation.

        The standard deviation is that on each axis; the correlation is that of each horizontal velocity with the error of the
        inclination by which gravity causes it. The velocity's error is that of the mean, and that of the slope since the middle
        of the time t. For evenly spread errors of v the mean has the variance of the fitted line's slope times t^2 / 12.
        """
        t, std = self._elapsed, self.std(gravity)
        share, variance = self._share(std)
        slope = (s + share * (gravity * e - s) for s, e in zip(self._slope(), self._earlier))
        x, y, z = (v - a / t - 0.5 * t * s for v, a, s in zip(self._velocity, self._sum, slope))
        in_all = math.sqrt(std * std / 12.0 + variance / 4.0)
        return (x, y, z), in_all * gravity * t, 0.5 * math.sqrt(variance) / in_all

    def _scatter(self) -> float:
        """Return the mean square of the velocity's distance from the line, (m/s)^2."""
        t = self._elapsed
        slope, total = (sum(a * a for a in values) for values in (self._slope(), self._sum))
        return max(0.0, self._square / t - total / t**2 - slope * t * t / 12.0)

    def std(self, gravity: float) -> float:
        """Return the standard deviation of the line's inclination about each horizontal axis, rad."""
        t, at_rest = self._elapsed, math.hypot(START_STD, math.sqrt(self._shaken))
        if not t:
            return min(at_rest, LARGEST_STD)
        scatter = self._scatter()
        before = self._shaken * (SWING * gravity) ** 2 * SWING / (SWING + t)
        resolved = 12.0 * (scatter + before) / (1.0 + t / SWING)
        # A step of v by d turns the slope by 1.5 d / t at most.
        variance = resolved + 2.25 * self._unsure + (t * self._hidden(scatter)) ** 2
        return min(max(math.sqrt(variance) / (gravity * t), START_STD * SWING / t if t > SWING else at_rest), LARGEST_STD)

    def _hidden(self, scatter: float) -> float:
        """Return the RMS on each axis of the acceleration that is too slow to be left by the line, m/s^2."""
        t = self._elapsed
        left = self._force_square / t - sum(v * v for v in self._velocity) / t**2
        if left <= 0.0:
            return 0.0
        slow = min(math.pi * math.sqrt(scatter / left) / (_SLOWEST * t), 1.0)
        return _HIDDEN * slow * slow * math.sqrt(left / 3.0)


def _unit(vector: quat.Vector) -> quat.Vector:
    """Return the vector (3,) with length 1; zero stays."""
    x, y, z = vector
    length = math.hypot(x, y, z)
    return (x / length, y / length, z / length) if length > 0.0 else vector
