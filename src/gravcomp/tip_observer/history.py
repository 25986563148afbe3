"""What the model predicted lately: a measurement that arrives late is compared with the prediction for its own time."""

import bisect
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from gravcomp.full_model.shape import Response

_KEPT = 1.5  # of the longest delay


class Prediction(NamedTuple):
    """The model at one time: stamp in s, tip (3,) in m, its orientation (4,) x y z w, response and tensions (m,) in N.

    touching: whether it leans on an obstacle.
    """

    stamp: float
    tip_position: np.ndarray
    tip_orientation: np.ndarray
    response: "Response"
    tension: np.ndarray
    touching: bool = False

    def gravity_part(self, rest_tip: np.ndarray) -> np.ndarray:
        """Return by how much (3,) in m gravity displaces the tip of the released robot, by the linear response.

        rest_tip (3,) in m: tip at rest without gravity.
        """
        return self.response.effector_free[:3] - rest_tip

    def cable_part(self) -> np.ndarray:
        """Return by how much (3,) in m the cables displace the tip, by the linear response."""
        return self.response.compliance_ea[:3] @ self.tension

    def sensitivity(self, rest_tip: np.ndarray) -> np.ndarray:
        """Return the derivative (3,) in m of the tip with respect to the relative error of weight over stiffness.

        The winches hold the displacements u of the taut cables. With the gravity scaled by 1 + s,

            u = W_aa lambda + (1 + s) delta_g,   e = W_ea lambda + e_rest + (1 + s) e_g,

        so de/ds = e_g - W_ea W_aa^-1 delta_g over the taut cables. A wrong modulus acts in the same way: it scales W and e_g
        alike, and with u held only the ratio of weight and stiffness is left.
        """
        taut = self.tension > 0.0
        gravity = self.gravity_part(rest_tip)
        if not taut.any():
            return gravity
        compliance = self.response.compliance_aa[np.ix_(taut, taut)]
        relieved = np.linalg.lstsq(compliance, self.response.displacement_free[taut], rcond=None)[0]
        return gravity - self.response.compliance_ea[:3][:, taut] @ relieved


class History:
    """The predictions of the last seconds, in order of time."""

    def __init__(self, longest_delay: float):
        """longest_delay in s: of a measurement."""
        self._span = _KEPT * longest_delay
        self._entries: list[Prediction] = []

    def __bool__(self) -> bool:
        return bool(self._entries)

    @property
    def newest(self) -> Prediction:
        """The newest prediction. Raises IndexError where there is none."""
        return self._entries[-1]

    @property
    def oldest(self) -> Prediction:
        """The oldest prediction that is kept. Raises IndexError where there is none."""
        return self._entries[0]

    def add(self, prediction: Prediction) -> None:
        """Append a prediction. Time that runs backwards begins a new history."""
        if self._entries and prediction.stamp <= self._entries[-1].stamp:
            if prediction.stamp == self._entries[-1].stamp:
                self._entries[-1] = prediction
                return
            self._entries.clear()
        self._entries.append(prediction)
        if self._entries[len(self._entries) // 2].stamp < prediction.stamp - self._span:
            del self._entries[: len(self._entries) // 2]

    def at(self, stamp: float) -> Prediction:
        """Return the prediction for `stamp` (s): its tip is interpolated, the rest is that of the nearest entry."""
        index = bisect.bisect(self._entries, stamp, key=lambda entry: entry.stamp)
        if index == 0:
            return self._entries[0]
        if index == len(self._entries):
            return self._entries[-1]
        before, after = self._entries[index - 1], self._entries[index]
        share = (stamp - before.stamp) / (after.stamp - before.stamp)
        nearest = after if share > 0.5 else before
        return nearest._replace(stamp=stamp, tip_position=(1.0 - share) * before.tip_position + share * after.tip_position)
