"""Does the measured tip move as the model's does? Where a scene is wrong, or something unknown is in the way, it does not.

Both are compared with where they were when they last agreed; at first, where the model was at rest and leant on nothing.
They disagree where their ways differ by more than noise explains, and by half of the longer one; by a fifth where the model
leans on an obstacle, as the robot may lean on it elsewhere. A robot that does not move while its model moves on is held by
something: a correction of the target by the difference would press it on, farther with every measurement. A robot that
moves while its model leans on an obstacle is not held by it.
"""

import collections
import enum

import numpy as np

_MEAN = 5  # measurements whose mean is compared
_WAY = 0.01  # of the robot's length, and
_DEVIATIONS = 6.0  # standard deviations of such a mean: ways that count
_DIFFERENCE, _TOUCHING = 0.5, 0.2  # of the longer way: apart from obstacles, and where the model leans on one
_REST = 0.25  # of such a way: a model that moves less in these measurements is at rest
_LEAST = 3  # measurements, and
_LAGS = 3.0  # times by which the robot follows late: how long they have to disagree


class Disagreement(enum.Enum):
    """In which way the measured tip moves otherwise than the model's."""

    NONE = 0
    HELD = 1
    LOOSE = 2


class MotionCheck:
    """Compares the motions of measured and modelled tip of one robot.

    agrees: whether they agreed at the last measurement; sentence: in which way they disagree, empty where they do not.
    """

    def __init__(self, length: float, std: float, lag: float):
        """length of the robot in m; std in m: of a measurement; lag in s: by how much the robot may follow late."""
        self._way, self._time = max(_WAY * length, _DEVIATIONS * std / _MEAN**0.5), _LAGS * lag
        self.forget()

    def forget(self) -> None:
        """Begin again at the next measurement."""
        self._agreed: tuple[np.ndarray, np.ndarray] | None = None
        self._last: collections.deque[tuple[np.ndarray, np.ndarray]] = collections.deque(maxlen=_MEAN)
        self.agrees = True
        self._began()

    def _began(self) -> None:
        self._kind, self._since, self._count = Disagreement.NONE, 0.0, 0
        self.sentence = ""

    def observe(self, time: float, measured: np.ndarray, modelled: np.ndarray, touching: bool) -> Disagreement:
        """Take tips (3,) in m at `time` (s); touching: the model leans on an obstacle. Return what they show."""
        self._last.append((measured, modelled))
        if len(self._last) < _MEAN:
            return Disagreement.NONE
        measured, modelled = (np.mean(tips, axis=0) for tips in zip(*self._last))
        at_rest = max(float(np.linalg.norm(tip - modelled)) for _, tip in self._last) < _REST * self._way
        if self._agreed is None:
            if not at_rest or touching:
                return Disagreement.NONE
            self._agreed = measured, modelled
        own, foreseen = measured - self._agreed[0], modelled - self._agreed[1]
        moved, expected = float(np.linalg.norm(own)), float(np.linalg.norm(foreseen))
        longer = max(moved, expected)
        difference = float(np.linalg.norm(own - foreseen))
        allowed = max((_TOUCHING if touching else _DIFFERENCE) * longer, self._way)
        self.agrees = difference < 0.5 * allowed
        if difference < allowed:
            if difference < 0.5 * _TOUCHING * longer:
                self._agreed = measured, modelled
            self._began()
            return Disagreement.NONE
        if self._count == 0:
            self._since = time
            self._kind = Disagreement.HELD if expected > moved else Disagreement.LOOSE
        self._count += 1
        if self._count < _LEAST or time - self._since < self._time:
            return Disagreement.NONE
        if self._kind is Disagreement.LOOSE and not touching:  # a load, or a tracker that was moved
            self._agreed = measured, modelled
            self._began()
            return Disagreement.NONE
        ways = f"the model's tip has moved by {1e3 * expected:.1f} mm, the measured one by {1e3 * moved:.1f} mm"
        why = (
            "something that the scene does not have there holds the robot"
            if self._kind is Disagreement.HELD
            else "the obstacle on which the model leans is not where the scene has it"
        )
        place = ", ".join(f"{1e3 * x:.1f}" for x in measured)
        self.sentence = f"measured and predicted motion disagree at ({place}) mm: {ways}; {why}"
        return self._kind
