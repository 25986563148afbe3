"""Acceleration of a point that an arm carries, from its poses over the last moments.

A parabola fitted to the positions p(t) of a short window gives the acceleration, constant over the window,

    a = 2 c_2,    p(t) ~ c_0 + c_1 t + c_2 t^2,

which is that of the middle of the window. Encoder noise s of n positions over the length W gives an error of about
27 s / (W^2 sqrt(n)).
"""

import collections

import numpy as np

from gravcomp.arm.chain import Chain

WINDOW = 0.04
"""s; at 10 m/s^3, about the jerk of fast arms, half of it changes the acceleration by 0.2 m/s^2 (1 deg for this moment only)."""

_LEAST = 5  # poses; an arm that sends fewer in the window has a longer one
_GAP = 0.05  # s between two poses, after which the motion in between is unknown


class CarriedPoint:
    """The point `place` (3,) m in the tip of a chain. Poses are given with their times."""

    def __init__(self, chain: Chain, place: np.ndarray):
        self._chain, self._place = chain, np.append(np.asarray(place, float), 1.0)
        self._poses: collections.deque[tuple[float, np.ndarray]] = collections.deque()

    def take(self, time: float, positions: dict[str, float]) -> np.ndarray | None:
        """Take the joint positions (rad or m) at a time (s); return the acceleration (3,) in m/s^2 in the tip.

        None while the window is not filled, after a gap, and after a time that goes back. Raises KeyError for a joint without a
        position.
        """
        if self._poses and time == self._poses[-1][0]:
            return None
        if self._poses and not 0.0 < time - self._poses[-1][0] <= _GAP:
            self._poses.clear()
        pose = self._chain.pose(positions)
        self._poses.append((time, (pose @ self._place)[:3]))
        while len(self._poses) > _LEAST and time - self._poses[0][0] > WINDOW:
            self._poses.popleft()
        if len(self._poses) < _LEAST or time - self._poses[0][0] < 0.5 * WINDOW:
            return None
        times = np.array([t for t, _ in self._poses]) - time
        fitted = np.polyfit(times, np.array([p for _, p in self._poses]), 2)
        return pose[:3, :3].T @ (2.0 * fitted[0])
