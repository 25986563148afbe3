"""The cascaded position loop of one cable: setpoint within velocity and acceleration limits, position, velocity, current.

    setpoint:   |x_s'| <= v_max, |x_s''| <= a_max, and it stops on the target
    velocity:   v_ref = x_s' + K_p (x_s - x), clamped to the velocity limit
    current:    i = K_v (v_ref - v) + K_i integral(v_ref - v) dt + T r / k_t

T is the tension that the controller's model expects; it is a feed-forward. The integral compensates the friction. It does not
grow while the current is at its limit. It is frozen while the cable is at rest within REST_COUNTS of its setpoint: gears stick,
and an integral that moves below the friction makes them creep back and forth (hunting).

A loop that answers late is made slower as a whole, by a softness s from 1 to 0: with s K_p, s K_v and s^2 K_i the ratios of its
crossovers stay.
"""

from gravcomp.description.hardware import Drive
from gravcomp.motors.setpoint import Setpoint

REST_COUNTS = 37.5
"""Counts of the rotor's encoder, 1.6 deg of the rotor, within which the integral is frozen."""


class PositionLoop:
    """Position loop of one cable. Attribute softness: 1 to 0, see above."""

    def __init__(self, drive: Drive, two_way: bool = False):
        """two_way: the motor pulls an antagonist when it turns back, so that the expected force may be negative."""
        self._rest_error = REST_COUNTS * drive.travel_per_count  # m
        self._drive, self._setpoint = drive, Setpoint(drive.acceleration_limit)
        self._least = -drive.tension_limit if two_way else drive.pretension
        self.softness = 1.0
        self.reset(0.0)

    def reset(self, displacement: float) -> None:
        """Start at rest at the measured displacement (m)."""
        self._setpoint.reset(displacement)
        self._integral = 0.0

    @property
    def setpoint(self) -> float:
        """Setpoint of the cable (m)."""
        return self._setpoint.position

    def step(
        self, target: float, tension: float, displacement: float, velocity: float, dt: float, velocity_limit: float | None = None
    ) -> float:
        """Return the current (A) that moves the cable toward `target` (m).

        `tension` (N) is the expected one, `displacement` (m) and `velocity` (m/s) are measured, `dt` (s) is the time since the
        last step, `velocity_limit` (m/s) replaces the drive's.
        """
        drive, softness = self._drive, self.softness
        limit = drive.velocity_limit if velocity_limit is None else velocity_limit
        setpoint = self._setpoint
        setpoint.advance(target, limit, dt)
        error = setpoint.position - displacement
        wanted = min(max(setpoint.velocity + softness * drive.position_gain * error, -limit), limit)
        feed_forward = min(max(tension, self._least), drive.tension_limit) / drive.tension_per_ampere
        proportional = softness * drive.velocity_gain * (wanted - velocity) + feed_forward
        at_rest = abs(error) < self._rest_error and setpoint.velocity == 0.0
        growth = softness**2 * drive.velocity_integral * (wanted - velocity) * dt
        integral = self._integral if at_rest else self._integral + growth
        current = proportional + integral
        if abs(current) < drive.current_limit or abs(integral) < abs(self._integral):
            self._integral = min(max(integral, -drive.current_limit), drive.current_limit)
        return min(max(proportional + self._integral, -drive.current_limit), drive.current_limit)
