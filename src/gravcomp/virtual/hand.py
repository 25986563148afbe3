"""A simulated hand that pulls the virtual robot's tip by a spring.

The spring is `_STIFFER` times as stiff as the tip of the unloaded rod, across its axis where it bends most easily, and pulls no
harder than what would bend the tip by half the robot's length if the rod stayed linear:

    1 / K = sum over the elements of h (L - s)^2 / (E I),    f = s K (hand - tip),    |f| <= K L / 2

So a hand suits every robot. Its place follows the orders by a lag, because orders come as often as a screen is drawn.
"""

import math
from dataclasses import dataclass

import numpy as np

from gravcomp.config import parameter
from gravcomp.first_order_lag import lag_share
from gravcomp.virtual.rod import RodModel

_STIFFER = 3.0
_REACH = 0.5  # of the robot's length, by which the largest force would bend the tip
_LAG = 0.05  # s
_LONGEST_SILENCE = 0.5  # s without an order, after which the hand has let go


@dataclass(frozen=True)
class HandOrder:
    """Where a hand is."""

    place: tuple[float, float, float] = parameter(
        edge="mm", minimum=-1e5, maximum=1e5, description="place of the hand in soft_base, towards which a spring pulls the tip"
    )


class Hand:
    """A hand next to a rod. Attributes: force_max (N), the largest force; force (3,) N in soft_base, as of the last step."""

    def __init__(self, model: RodModel):
        length = float(model.length.sum())
        middle = (np.cumsum(model.length) - model.length / 2) / length
        weakest = np.linalg.eigvalsh(model.stiffness[:, 3:5, 3:5])[:, 0]
        tip_stiffness = 1.0 / float((model.length * (length * (1.0 - middle)) ** 2 / weakest).sum())
        self._stiffness = _STIFFER * tip_stiffness
        self.force_max = _REACH * length * tip_stiffness
        self.force = np.zeros(3)
        self._wanted: np.ndarray | None = None
        self._place: np.ndarray | None = None
        self._ordered = self._stepped = -math.inf

    @property
    def holds(self) -> bool:
        """Whether it holds the tip; without that it pulls by nothing."""
        return self._wanted is not None

    def hold(self, place: np.ndarray, time: float) -> None:
        """Hold the tip from `time` (s) on by a spring to the place (3,) m in soft_base, until released or forgotten."""
        self._wanted, self._ordered = np.asarray(place, dtype=float), time

    def release(self) -> None:
        """Let go."""
        self._wanted = self._place = None
        self.force = np.zeros(3)

    def pull(self, tip: np.ndarray, time: float) -> np.ndarray:
        """Return the force (3,) N in soft_base on the tip, which is at (3,) m there at `time` s."""
        if self._wanted is None:
            return self.force
        if time - self._ordered > _LONGEST_SILENCE:
            self.release()
            return self.force
        if self._place is None:  # a hand that takes hold begins where the tip is
            self._place = np.array(tip)
        else:
            self._place = self._place + lag_share(self._stepped, time, _LAG) * (self._wanted - self._place)
        self._stepped = time
        force = self._stiffness * (self._place - tip)
        size = float(np.linalg.norm(force))
        self.force = force * min(1.0, self.force_max / size) if size > 0.0 else force
        return self.force
