"""The force that an anchored model needs, averaged for as long as what is measured agrees with it.

The model's tip follows the measured one, so the tracker's noise is in the force. A robot whose winches hold is stiff along the
line from base to tip: 0.5 mm there are 0.09 N on the article's robot; a mean of 2 s is wrong by a fifth of 0.15 N. The mean is
that of all tips since the force came. A later one weighs more, by the time since then: at first the robot swings and creeps.
Beyond `LoadEstimationOptions.force_time` the mean forgets (exponential smoothing).

The force has changed where the mean of the last `KEPT` seconds would put the tip elsewhere. With the compliance C of the held
robot and n tips of the deviation s in this time, |C (f_lately - f)|^2 n / s^2 is then beyond chi-square of three numbers.
"""

import collections

import numpy as np

from gravcomp.load_estimation.options import LoadEstimationOptions
from gravcomp.load_estimation.predictions import KEPT

_GATE = 11.3  # 1 in 100 good means is farther (chi-square, 3 numbers); one that is taken for a change costs the older tips
_LATER = 2.0  # weights that grow with the time: of a mean over a time t, the first second has 1 / t^2


class NeededForce:
    """The force at the tip of one robot."""

    def __init__(self, options: LoadEstimationOptions):
        self._options = options
        self._tips: collections.deque[float] = collections.deque()  # s, stamps of the measured tips of the last `KEPT` seconds
        self.reset()

    def reset(self) -> None:
        """Forget the force."""
        self.mean = np.zeros(3)
        self._age, self._last = 0.0, np.nan

    def tip_measured(self, stamp: float) -> None:
        """Count a tip that was measured at a stamp (s)."""
        if self._tips and stamp < self._tips[-1]:  # a replay has restarted
            self._tips.clear()
        self._tips.append(stamp)
        while self._tips[0] < stamp - KEPT:
            self._tips.popleft()

    def add(self, stamp: float, force: np.ndarray, lately: np.ndarray, compliance: np.ndarray) -> None:
        """Take the force (3,) N that the model needs at a stamp (s).

        lately (3,) N: its mean over the last `KEPT` seconds; compliance (3, 3) m/N: of the tip while the winches hold.
        """
        elapsed, self._last = stamp - self._last, stamp
        if not 0.0 < elapsed <= KEPT:
            self.mean, self._age = lately.copy(), 0.0
            return
        self._age += elapsed
        share = min(1.0, _LATER * elapsed / min(self._age, self._options.force_time))
        self.mean = self.mean + share * (force - self.mean)
        off = compliance @ (lately - self.mean)
        # The first shapes are of a model that has just come to the tip, and of a robot that may still swing.
        if self._age <= KEPT or float(off @ off) * len(self._tips) > _GATE * self._options.tip_std**2:
            self.mean, self._age = lately.copy(), min(self._age, KEPT)
