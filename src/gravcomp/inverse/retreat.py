"""Recovery when the equilibrium is lost or the closed loop is stuck.

Not every command has an equilibrium near the last one (see `full_model.statics`). And Gauss-Newton steps toward a target on the
other side of a strongly bent robot may end in a local minimum of the distance.

- If the model cannot follow a command, the command is taken back to the present shape. The next strides are shorter, as in a
  trust-region method, and grow with each command that the model follows. So the robot comes to rest where the branch of
  equilibria ends.
- If the model does not follow that either, its cables are paid out, which reduces its load.
- If the equilibrium was lost several times or nothing moves any more, and the robot is far from a target to which the released
  robot is nearer, the cables are paid out until half of the tension is left. From there the target is tried again: another path
  may lead to it. The next attempts start from a quarter of the tension and from no tension. A new target starts this sequence
  again.
"""

import enum
import math

import numpy as np

from gravcomp.inverse.target import Target
from gravcomp.standard_gravity import STANDARD_GRAVITY

_SHORTER, _LONGER = 0.25, 1.05
_LEAST_STRIDE = 1.0 / 256.0
_LOST_TIMES = 3
_BACK_STEPS = 2  # the model may be one sample behind the commands
# Nothing moves if no cable is faster than this share of the speed of a fall from the robot's length, for this number of steps.
_SLOW = 2e-3
_STILL_STEPS = 20
_FAR = 0.3  # of the robot's length
_SHARES = (0.5, 0.25, 0.0)  # fractions of the tension at which a target is tried again
_NO_TENSION, _LITTLE_TENSION = 0.004, 0.02  # of the largest tension


class Move(enum.Enum):
    """Kind of the next command: a step to the target, back to the present shape, or paying the cables out."""

    ONWARD = 0
    BACK = 1
    PAY_OUT = 2


class Retreat:
    """Chooses the moves of a robot of `length` (m), its tip at `tip_at_rest` (3,) in m, with cables of at most `tension_max` (N).

    Attribute `stride`: fraction of the usual stride that a step may take.
    """

    def __init__(self, length: float, tension_max: float, tip_at_rest: np.ndarray):
        self._length, self._tension_max = length, tension_max
        self._slow = _SLOW * math.sqrt(STANDARD_GRAVITY * length)  # m/s
        self._tip_at_rest = tip_at_rest  # until it is observed
        self.reset()

    def reset(self) -> None:
        """Forget all earlier steps."""
        self.stride = 1.0
        self._lost = self._lost_times = self._still = self._tries = 0
        self._until: float | None = None  # N: largest tension at which the next attempt starts
        self._target: Target | None = None

    def move(self, followed: bool, target: Target, tip: np.ndarray, tension: np.ndarray) -> Move:
        """Return the next move.

        followed: whether the model reached an equilibrium under the last command; tip (3,) in m and tension (m,) in N of its
        present shape.
        """
        if not _same(target, self._target):
            self._target, self._tries, self._lost_times, self._still, self._until = target, 0, 0, 0, None
        if followed and max(tension.tolist()) <= _LITTLE_TENSION * self._tension_max:
            self._tip_at_rest = tip
        if not followed:
            self._lost += 1
            if self._lost == 1:
                self._lost_times += 1
                self.stride = max(_SHORTER * self.stride, _LEAST_STRIDE)
            if self._lost_times >= _LOST_TIMES:
                self._try_again(tip, tension)
            return Move.BACK if self._lost <= _BACK_STEPS else Move.PAY_OUT
        self._lost = 0
        self.stride = min(_LONGER * self.stride, 1.0)
        if self._still >= _STILL_STEPS:
            self._still = 0
            self._try_again(tip, tension)
        if self._until is not None:
            if tension.max() > self._until:
                return Move.PAY_OUT
            self._until, self.stride = None, 1.0
        return Move.ONWARD

    def observe(self, change: np.ndarray, interval: float, held: bool = False) -> None:
        """Record a move onward: the change (m,) of the winches' displacement in m, within `interval` s.

        held: what is around the robot keeps it where it is; another path does not lead past it.
        """
        at_rest = all(abs(winch) <= self._slow * interval for winch in change.tolist())
        self._still = self._still + 1 if at_rest and not held else 0

    def _try_again(self, tip: np.ndarray, tension: np.ndarray) -> None:
        """Start paying the cables out if another attempt from there may get nearer to the target."""
        assert self._target is not None  # `move` has set it
        wanted = self._target.tip_position
        missed = np.linalg.norm(tip - wanted)
        nearer_at_rest = np.linalg.norm(self._tip_at_rest - wanted) < missed
        asked = self._target.tip_position_weight > 0.0
        if self._until is None and self._tries < len(_SHARES) and asked and nearer_at_rest and missed > _FAR * self._length:
            self._until = max(_SHARES[self._tries] * tension.max(), _NO_TENSION * self._tension_max)
            self._tries += 1
            self._lost_times = 0


def _same(target: Target, other: Target | None) -> bool:
    if target is other or other is None:
        return target is other
    return np.array_equal(target.tip_position, other.tip_position) and np.array_equal(
        target.direction_or_zeros, other.direction_or_zeros
    )
