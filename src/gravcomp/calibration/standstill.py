"""When a robot counts as being at rest, and as moving: in shares of its length and multiples of its first period."""

from dataclasses import dataclass

import numpy as np

from gravcomp.config import parameter
from gravcomp.description import Robot


@dataclass(frozen=True)
class StandstillOptions:
    """Thresholds without a unit, so that they suit a robot of any size and softness."""

    periods: float = parameter(1.8, minimum=0.1, maximum=100.0, description="length of a window at rest, in first periods")
    tip_share: float = parameter(0.006, minimum=1e-6, maximum=0.5, description="largest motion of the tip, over the length")
    tip_noises: float = parameter(6.0, minimum=2.0, maximum=100.0, description="the same in deviations of the tracker's noise")
    cable_share: float = parameter(5e-4, minimum=1e-6, maximum=0.5, description="largest motion of a cable, over the length")
    gravity: float = parameter(0.5, edge="deg", minimum=1e-4, maximum=90.0, description="largest turn of the base")
    motion_share: float = parameter(
        0.03, minimum=1e-4, maximum=1.0, description="a tip that moves this far in a window shows the damping, over the length"
    )
    motion_periods: float = parameter(
        14.0, minimum=1.0, maximum=1000.0, description="length of a motion that is fitted, in first periods"
    )


@dataclass(frozen=True)
class Standstill:
    """Thresholds of one robot. time in s; tip and cable in m; gravity in rad; noises as in the options.

    moving (m) within `time`: a trial that moves this far shows the damping; motion (s): how much of it is used.
    """

    time: float
    tip: float
    cable: float
    gravity: float
    noises: float
    moving: float
    motion: float

    @staticmethod
    def of(robot: Robot, period: float, options: StandstillOptions | None = None) -> "Standstill":
        """Return the thresholds of a robot with the first period `period` in s."""
        options = options or StandstillOptions()
        return Standstill(
            time=options.periods * period,
            tip=options.tip_share * robot.length,
            cable=options.cable_share * robot.length,
            gravity=options.gravity,
            noises=options.tip_noises,
            moving=options.motion_share * robot.length,
            motion=options.motion_periods * period,
        )

    def tip_limit(self, tip: np.ndarray) -> float:
        """Return the largest motion in m of a tip (t, 3) at rest, which its noise alone does not exceed."""
        return max(self.tip, self.noises * noise_of(tip))

    def samples(self, time: np.ndarray) -> int:
        """Return the number of samples of a window in a trial that is measured at the times (t,) in s."""
        return max(_FEWEST, round(self.time / max(float(np.median(np.diff(time))), 1e-6))) if len(time) > 1 else _FEWEST


_FEWEST = 5  # samples: fewer do not show whether anything moves


def noise_of(tip: np.ndarray) -> float:
    """Return the standard deviation in m of the noise of a course (t, 3) of the tip, from its second differences.

    The median of their size leaves out the moments in which the tip moves fast.
    """
    if len(tip) < _FEWEST:
        return 0.0
    curved = tip[2:] - 2.0 * tip[1:-1] + tip[:-2]  # of white noise: variance 6
    return float(np.median(np.abs(curved)) / 0.6745 / np.sqrt(6.0))
