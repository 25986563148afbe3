"""The plan of a calibration: poses of the base and pulls of the cables, with the times for which they are held.

`planning` makes it, `plan_table` writes it on paper, `live` goes through it on the running robot.
"""

import math
from dataclasses import dataclass

import numpy as np

from gravcomp.config import parameter
from gravcomp.standard_gravity import STANDARD_GRAVITY


@dataclass(frozen=True)
class PlanOptions:
    """How long a calibration takes, and how far it bends the robot."""

    budget: float = parameter(180.0, unit="s", minimum=10.0, maximum=3600.0, description="robot time of all poses together")
    periods: float = parameter(14.0, minimum=2.0, maximum=200.0, description="first periods of the robot at rest in each pose")
    fewest: int = parameter(12, minimum=3, maximum=200, description="poses for whose sake the time at rest is shortened")
    most: int = parameter(26, minimum=3, maximum=500, description="poses beyond which the time at rest is lengthened instead")
    assured: int = parameter(
        0,
        minimum=0,
        maximum=200,
        description="poses that are measured even where they take longer than the budget",
    )
    rate: float = parameter(40.0, edge="deg", minimum=1.0, maximum=360.0, description="speed of the base's turns, deg/s")
    bend: float = parameter(35.0, edge="deg", minimum=1.0, maximum=180.0, description="largest turn of the tip by a cable")
    slack: float = parameter(
        0.05, minimum=1e-3, maximum=1.0, description="of a released cable beyond its path, over the robot's length"
    )
    tension: float = parameter(0.7, minimum=0.01, maximum=1.0, description="largest tension, over the limit")


@dataclass(frozen=True)
class PlannedPose:
    """One pose: the base at inclination and roll in rad (`virtual.motion`), the cables at `displacement` (m,) in m.

    pulled: names of the cables that are to be taut; tension (m,) in N and tip (3,) in m: as the model expects them.
    """

    inclination: float
    roll: float
    displacement: np.ndarray
    pulled: tuple[str, ...]
    tension: np.ndarray
    tip: np.ndarray

    @property
    def station(self) -> tuple[float, float]:
        """Inclination and roll, by which poses with the same orientation of the base are known."""
        return self.inclination, self.roll

    @property
    def gravity(self) -> np.ndarray:
        """Gravity (3,) in m/s^2 in soft_base."""
        return gravity_of(self.inclination, self.roll)


@dataclass(frozen=True)
class Plan:
    """Poses in the order in which they are measured.

    times: for which each is held in s, with the move of the cables; rate: of the base's turns in rad/s; rest: time at rest in s;
    note: what limits the plan, a sentence or empty.
    """

    poses: tuple[PlannedPose, ...]
    times: tuple[float, ...]
    rest: float
    rate: float
    note: str = ""

    @property
    def duration(self) -> float:
        """Robot time in s, with the turns of the base."""
        return sum(self.times) + sum(turn_time(a, b, self.rate) for a, b in zip(self.poses, self.poses[1:]))


def turn_time(one: PlannedPose, other: PlannedPose, rate: float) -> float:
    """Return the time in s of the turn of the base between two poses at `rate` rad/s."""
    from scipy.spatial.transform import Rotation

    a, b = (Rotation.from_euler("yz", [-pose.inclination, pose.roll]) for pose in (one, other))
    return float((a.inv() * b).magnitude()) / rate


def creep_times(rest: float) -> tuple[float, ...]:
    """Return the times in s of the branches of creep that rests of `rest` s show: below them, and beyond."""
    return 0.3 * rest, 3.0 * rest


def gravity_of(inclination: float, roll: float) -> np.ndarray:
    """Return gravity (3,) in m/s^2 in soft_base for an inclination of the robot's axis and a roll about it, in rad."""
    c, s = math.cos(inclination), math.sin(inclination)
    return -STANDARD_GRAVITY * np.array([c * math.cos(roll), -c * math.sin(roll), s])
