"""What a turn of the base adds to gravity: d'Alembert's forces, as one field that acts on a model at rest.

In the frame of a base that turns with the rate w, which changes by a = dw/dt, a mass at r is drawn by

    g - a x r - w x (w x r)

These forces grow along the robot. The field is theirs at the place (0, 0, h) at which a uniform one moves the tip as far as they
do: h = u(z) / u(1), where u(p) is the tip's deflection of the straight robot by the forces m p across it. A clamped uniform beam
has h = 11/15 of its length. Rayleigh's quotient of the deflections v by m gives the first period (Bathe, Finite Element
Procedures, 1996, section 10.3)

    T = 2 pi sqrt(sum m v^2 / sum m v),

and w is low-passed by a share of it before it is differentiated: the robot follows nothing that is faster. The forces of the path
of the base itself are not in the field: where the IMU sits on the base is not known well enough to tell them from its errors.
"""

import collections
import math

import numpy as np

from gravcomp.external_loads.options import BaseTurnOptions
from gravcomp.first_order_lag import lag_share
from gravcomp.full_model.robot_model import RobotModel

_KEPT = 16  # rates that wait for a later sample of gravity
_STALE = 10.0  # mean intervals between rates, after which the last one says nothing
_SHARE = 0.1  # of a new interval in the mean: rates that come in bursts are no gaps


class BaseTurn:
    """Follows the rate of a base.

    Attributes: height in m, h of the module; period in s, T; options, of which `lag` may be replaced while it runs.
    """

    def __init__(self, model: RobotModel, options: BaseTurnOptions):
        self.height, self.period = _height_and_period(model)
        self.options = options
        self.reset()

    def reset(self) -> None:
        """Forget the rates: the next one begins."""
        self._waiting: collections.deque[tuple[float, np.ndarray]] = collections.deque(maxlen=_KEPT)
        self._time, self._interval = -math.inf, math.inf
        self._rate, self._acting = np.zeros(3), np.zeros(3)

    def add(self, time: float, rate: np.ndarray) -> None:
        """Take the rate (3,) in rad/s in soft_base at `time` s; one that is not finite is left out."""
        if np.isfinite(rate).all():
            if self._waiting and time < self._waiting[-1][0]:
                self._waiting.clear()  # a replay has restarted: what waits is of its end
            self._waiting.append((time, np.array(rate, dtype=float)))

    def acceleration(self, time: float) -> np.ndarray:
        """Return what adds to gravity (3,) in m/s^2 in soft_base at `time` s, by the rates before it; zeros without fresh ones.

        The rate of the sample itself does not count: in the graph it may come a little later, and the result does not depend on
        that.
        """
        while self._waiting and self._waiting[0][0] < time:
            self._follow(*self._waiting.popleft())
        return self._acting if self.options.enabled and self._fresh(time) else np.zeros(3)

    def _fresh(self, time: float) -> bool:
        """Return whether the last rate says something about `time` s."""
        return 0.0 < time - self._time < math.inf and time - self._time <= _STALE * self._interval

    def _follow(self, time: float, rate: np.ndarray) -> None:
        """Go on to a rate; after a gap, and where time runs backwards as at a restart of a replay, it begins again."""
        interval, fresh = time - self._time, self._fresh(time)
        if not 0.0 < interval < math.inf:
            self._interval = math.inf
        elif math.isfinite(self._interval):
            self._interval += _SHARE * (min(interval, _STALE * self._interval) - self._interval)
        else:
            self._interval = interval
        if not fresh:
            self._time, self._rate, self._acting = time, rate, np.zeros(3)
            return
        step = lag_share(self._time, time, self.options.lag * self.period) * (rate - self._rate)
        self._rate, self._time = self._rate + step, time
        ax, ay, _ = (step / interval).tolist()
        wx, wy, wz = self._rate.tolist()
        # - a x r - w x (w x r) at r = (0, 0, h)
        self._acting = self.height * np.array([-ay - wx * wz, ax - wy * wz, wx * wx + wy * wy])


def _height_and_period(model: RobotModel) -> tuple[float, float]:
    """Return h in m and T in s of the straight robot, as means over both directions across it; 0 and inf without weight."""
    mass, along = model.nodal_weight[: model.n_free], model.mesh.nodes[: model.n_free, 2]
    if not mass.any():
        return 0.0, math.inf
    stiffness = model.new_matrix()
    model.elements.assemble(np.zeros_like(model.mesh.nodes), stiffness)
    loads = np.zeros((model.n_free, 3, 4))
    for axis in range(2):
        loads[:, axis, axis], loads[:, axis, 2 + axis] = mass, mass * along
    moved = stiffness.factor().solve(loads.reshape(-1, 4)).reshape(model.n_free, 3, 4)
    height, period = [], []
    for axis in range(2):
        uniform, growing = (float(model.effectors.tip_weights[: model.n_free] @ moved[:, axis, k]) for k in (axis, 2 + axis))
        height.append(growing / uniform)
        deflection = moved[:, axis, axis]
        period.append(2.0 * math.pi * math.sqrt(float(mass @ deflection**2) / float(mass @ deflection)))
    return float(np.mean(height)), float(np.mean(period))
