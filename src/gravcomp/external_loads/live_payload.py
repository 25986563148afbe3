"""A payload that changes while the robot runs: the difference from the one of the robot file, ramped."""

import math

import numpy as np

from gravcomp.config import ConfigError
from gravcomp.description import Robot
from gravcomp.first_order_lag import lag_share
from gravcomp.full_model.wrench import Wrench


class LivePayload:
    """Mass at the tip of one robot."""

    def __init__(self, robot: Robot, ramp_time: float):
        """ramp_time in s: time constant of a change."""
        self._robot, self.ramp_time = robot, ramp_time
        self._wanted = self._mass = robot.payload.mass
        self._at = -math.inf

    @property
    def mass(self) -> float:
        """Mass in kg that the model carries now."""
        return self._mass

    def check(self, mass: float) -> None:
        """Raise ConfigError for a mass in kg that the robot cannot carry.

        The cables cannot lift more than they pull; a robot without cables counts as one with a single cable.
        """
        if not math.isfinite(mass) or mass < 0.0:
            raise ConfigError(f"payload.mass_g is {1e3 * mass:g}; 0 or more is allowed")
        limits = self._robot.limits
        most = limits.tension_max * max(len(self._robot.cables), 1) / 9.81
        if mass > most:
            raise ConfigError(
                f"payload.mass_g is {1e3 * mass:.4g}; all cables at limits.tension_max = {limits.tension_max:g} N lift"
                f" {1e3 * most:.4g} g: a heavier payload breaks the robot"
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
