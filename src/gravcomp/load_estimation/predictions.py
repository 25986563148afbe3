"""What the models have expected lately, so that measurements which arrive late meet the shape to which they belong."""

import collections
from typing import NamedTuple

import numpy as np

from gravcomp.load_estimation.sensitivity import HeldRobot

KEPT = 2.0  # s of predictions, for measurements that arrive late
_APART = 0.1  # s, farthest of a measurement from the predictions: without an equilibrium the model has no new ones


class Prediction(NamedTuple):
    """A shape of a model at a stamp in s.

    tip (3,) m; tension (m,) N; carried (3,) N: the force at the tip that the model carries; gravity (3,) m/s^2; covariance (3, 3)
    N^2 of the force that an anchored model carries, None: the shape is of the running model.
    """

    stamp: float
    tip: np.ndarray
    tension: np.ndarray
    robot: HeldRobot
    carried: np.ndarray
    gravity: np.ndarray
    covariance: np.ndarray | None

    @property
    def anchored(self) -> bool:
        """Whether the tip of the model was held where it was measured."""
        return self.covariance is not None


class Predictions:
    """The predictions of the last `KEPT` seconds, the newest last."""

    def __init__(self) -> None:
        self._kept: collections.deque[Prediction] = collections.deque()

    @property
    def newest(self) -> Prediction | None:
        """The newest prediction."""
        return self._kept[-1] if self._kept else None

    def add(self, prediction: Prediction) -> bool:
        """Remember a prediction; if its stamp goes back, as when a replay restarts, forget all others and return True."""
        back = bool(self._kept) and prediction.stamp < self._kept[-1].stamp
        if back:
            self._kept.clear()
        self._kept.append(prediction)
        while self._kept[0].stamp < prediction.stamp - KEPT:
            self._kept.popleft()
        return back

    def at(self, stamp: float) -> Prediction | None:
        """Return the prediction nearest to a stamp; None for a stamp before the first one or far ahead."""
        if not self._kept or not np.isfinite(stamp):
            return None
        if not self._kept[0].stamp - _APART <= stamp <= self._kept[-1].stamp + _APART:
            return None
        nearest = self._kept[-1]
        for entry in reversed(self._kept):  # what is asked for is nearly always among the newest
            if abs(entry.stamp - stamp) > abs(nearest.stamp - stamp):
                break
            nearest = entry
        return nearest

    def moved(self, then: Prediction, lag: float) -> tuple[np.ndarray, np.ndarray]:
        """Return by how much a robot that is `lag` s late may be behind a prediction: tip (3,) m and tensions (m,) N."""
        behind = self.at(max(then.stamp - lag, self._kept[0].stamp)) or then
        if then.anchored:
            return then.robot.by_winding(behind.robot)
        return then.tip - behind.tip, then.tension - behind.tension

    def needed(self) -> np.ndarray:
        """Return the force (3,) N that the anchored model has carried lately, on average. There is a prediction of that model."""
        force: np.ndarray = np.mean([entry.carried for entry in self._kept if entry.anchored], axis=0)
        return force
