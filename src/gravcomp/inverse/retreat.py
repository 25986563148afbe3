"""Ways out where a step of the closed loop does not lead on.

Not every command has an equilibrium near the last one (see `simulation.statics`), and Gauss-Newton's steps toward a target far around
the corner may end at a distance that is the least nearby without being small.

- A command that the model could not follow is taken back, to the shape that stands. The next strides are shorter, as in a trust-region
  method, and grow with each command that is followed: the robot comes to rest where the equilibria end.
- Where the model does not follow that either, its cables are paid out, which takes load from it.
- Where the model was lost several times, or nothing moves any more, far from a target that the robot at rest is nearer to, the cables are
  paid out until half of the tension is gone, and the target is tried from there: another way may lead to it. Then until a quarter is left,
  then nothing; a target that is new is tried anew.
"""

import enum

import numpy as np

from gravcomp.inverse.target import Target

_SHORTER, _LONGER = 0.25, 1.05
_LEAST_STRIDE = 1.0 / 256.0
_LOST_TIMES = 3
_BACK_STEPS = 2  # the model may be a sample behind the commands
# Nothing moves: no cable is faster than this for so many steps.
_SLOW = 2e-3  # m/s
_STILL_STEPS = 20
_FAR = 0.3  # robot's lengths
_SHARES = (0.5, 0.25, 0.0)  # of the tension, at which a target is tried again
_NO_TENSION, _LITTLE_TENSION = 0.02, 0.1  # N


class Move(enum.Enum):
    """What the next command shall be: a step to the target, the shape as it is, or longer cables."""

    ONWARD = 0
    BACK = 1
    PAY_OUT = 2


class Retreat:
    """Decides on the moves of a robot of `length` (m). Attribute `stride`: the share of the usual stride that a step may take."""

    def __init__(self, length: float):
        self._length = length
        self._tip_at_rest = np.array([0.0, 0.0, length])  # until it is seen: how far it sags, not where to, is what matters
        self.reset()

    def reset(self) -> None:
        """Forget the past."""
        self.stride = 1.0
        self._lost = self._lost_times = self._still = self._tries = 0
        self._until: float | None = None  # N, of the largest tension, while cables are paid out for another try
        self._target: Target | None = None

    def move(self, followed: bool, target: Target, tip: np.ndarray, tension: np.ndarray) -> Move:
        """The next move. followed: whether the model reached an equilibrium under the last command; tip (3,) m and tension (m,) N of
        its present shape.
        """
        if not _same(target, self._target):
            self._target, self._tries, self._lost_times, self._still, self._until = target, 0, 0, 0, None
        if followed and tension.max() <= _LITTLE_TENSION:
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

    def observe(self, change: np.ndarray, interval: float) -> None:
        """After a move onward: the change (m,) of the winches' displacement in m, in `interval` s."""
        self._still = self._still + 1 if np.abs(change).max() <= _SLOW * interval else 0

    def _try_again(self, tip: np.ndarray, tension: np.ndarray) -> None:
        """Let the cables be paid out where that may lead nearer to the target."""
        wanted = self._target.tip_position
        missed = np.linalg.norm(tip - wanted)
        nearer_at_rest = np.linalg.norm(self._tip_at_rest - wanted) < missed
        asked = self._target.tip_position_weight > 0.0
        if self._until is None and self._tries < len(_SHARES) and asked and nearer_at_rest and missed > _FAR * self._length:
            self._until = max(_SHARES[self._tries] * tension.max(), _NO_TENSION)
            self._tries += 1
            self._lost_times = 0


def _same(target: Target, other: Target | None) -> bool:
    if target is other or other is None:
        return target is other
    return np.array_equal(target.tip_position, other.tip_position) and np.array_equal(
        target.direction_or_zeros, other.direction_or_zeros
    )
