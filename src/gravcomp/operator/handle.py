"""The handle as the base of the virtual robot: it is pushed along its axis by a hand with tremor."""

import numpy as np

from gravcomp.virtual.motion import SyntheticMotion, TremorMotion


class PushedHandle(SyntheticMotion):
    """A handle that a hand with tremor pushes.

    It begins at `start` m along the axis of `orientation` (3, 3), world from soft_base. The hand follows its speed with a
    first-order lag (neuromuscular; McRuer and Jex 1967: about 0.1 s).
    """

    lag = 0.1  # s

    def __init__(self, orientation: np.ndarray, start: float, seed: int):
        self._tremor = TremorMotion(orientation, seed, drift=False)
        self._axis = orientation[:, 2]
        self._along, self._speed, self._time = start, 0.0, 0.0
        self.wanted = 0.0  # m/s

    @property
    def along(self) -> float:
        """Place along the axis at the last pose, m."""
        return self._along

    def pose(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Return rotation (3, 3), world from soft_base, and position (3,) m at `time` s."""
        dt = time - self._time
        if dt > 0.0:
            share = dt / (self.lag + dt)
            self._speed += share * (self.wanted - self._speed)
            self._along += dt * self._speed
            self._time = time
        orientation, shift = self._tremor.pose(time)
        return orientation, shift + self._axis * self._along
