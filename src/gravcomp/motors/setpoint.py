"""The setpoint of one cable: it moves to its target within limits of velocity and acceleration, and stops there.

|x_s'| <= v_max,  |x_s''| <= a_max
"""

import math


class Setpoint:
    """Setpoint of one cable. Attributes: position (m), velocity (m/s)."""

    def __init__(self, acceleration_limit: float):
        """acceleration_limit: m/s^2."""
        self._acceleration_limit = acceleration_limit
        self.reset(0.0)

    def reset(self, position: float) -> None:
        """Start at rest at a position (m)."""
        self.position, self.velocity = position, 0.0

    def advance(self, target: float, limit: float, dt: float) -> None:
        """Move toward `target` (m) for `dt` (s) at no more than `limit` (m/s)."""
        if dt <= 0.0:
            return
        remaining, change = target - self.position, self._acceleration_limit * dt
        # Largest v from which the setpoint can still stop on the target after this step: v dt + v^2 / (2 a_max) <= |remaining|.
        reachable = math.sqrt(change * change + 2 * self._acceleration_limit * abs(remaining)) - change
        wanted = math.copysign(min(limit, reachable), remaining)
        self.velocity += min(max(wanted - self.velocity, -change), change)
        if abs(remaining) <= 0.5 * change * dt and abs(self.velocity) <= change:
            self.position, self.velocity = target, 0.0
        else:
            self.position += self.velocity * dt
