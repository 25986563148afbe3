"""A payload that changes while the robot runs: the difference from the one of the robot file, ramped."""

import math

import numpy as np

from gravcomp.config import ConfigError
from gravcomp.description import Robot
from gravcomp.first_order_lag import lag_share
from gravcomp.full_model.wrench import Wrench
from gravcomp.standard_gravity import STANDARD_GRAVITY


class LivePayload:
    """Mass at the tip of one robot."""

    def __init__(self, robot: Robot, ramp_time: float, most: float = 0.0):
        """ramp_time in s: time constant of a change; most in kg: what the cables can hold (`holdable_payload`), 0: not known."""
        self._robot, self.ramp_time, self._most = robot, ramp_time, most
        self._wanted = self._mass = robot.payload.mass
        self._at = -math.inf

    @property
    def mass(self) -> float:
        """Mass in kg that the model carries now."""
        return self._mass

    def check(self, mass: float) -> None:
        """Raise ConfigError for a mass in kg that the robot cannot carry.

        Where it is not known what the cables can hold, they cannot lift more than they pull; a robot without cables counts as one
        with a single cable. The payload of the robot file is always allowed.
        """
        if not math.isfinite(mass) or mass < 0.0:
            raise ConfigError(f"payload.mass_g is {1e3 * mass:g}; 0 or more is allowed")
        limits, found = self._robot.limits, f"payload.mass_g is {1e3 * mass:.4g}; "
        lifted = limits.tension_max * max(len(self._robot.cables), 1) / STANDARD_GRAVITY
        if mass > lifted:
            raise ConfigError(
                f"{found}all cables at limits.tension_max = {limits.tension_max:g} N lift"
                f" {1e3 * lifted:.4g} g: a heavier payload breaks the robot"
            )
        if 0.0 < self._most < mass and mass > self._robot.payload.mass:
            raise ConfigError(
                f"{found}with limits.tension_max = {limits.tension_max:g} N the cables hold at most {1e3 * self._most:.4g} g at"
                " the tip of the horizontal robot. A robot that only hangs has its payload in its file (robot.payload)"
            )

    def set(self, mass: float) -> None:
        """Change the payload to a mass in kg. Raises ConfigError as `check`."""
        self.check(mass)
        self._wanted = mass

    def wrench(self, gravity: np.ndarray, now: float) -> Wrench | None:
        """Return what the robot file's payload lacks, at `now` (s) under gravity (3,); None: nothing."""
        self._mass += lag_share(self._at, now, self.ramp_time) * (self._wanted - self._mass)
        self._at = now
        more = self._mass - self._robot.payload.mass
        return Wrench(more * gravity, lever=np.array(self._robot.payload.centre)) if more else None
