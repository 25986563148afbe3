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

import math

import numpy as np

from gravcomp.external_loads.options import BaseTurnOptions
from gravcomp.first_order_lag import lag_share
from gravcomp.full_model.robot_model import RobotModel


class BaseTurn:
    """Follows the rate of a base.

    Attributes: height in m, h of the module; period in s, T; options, which may be replaced while it runs.
    """

    def __init__(self, model: RobotModel, options: BaseTurnOptions):
        self.height, self.period = _height_and_period(model)
        self.options = options
        self.reset()

    def reset(self) -> None:
        """Forget the rates: the next one begins."""
        self._time = -math.inf
        self._rate = np.zeros(3)

    def acceleration(self, time: float, rate: np.ndarray) -> np.ndarray:
        """Return what adds to gravity (3,) in m/s^2 in soft_base; rate (3,) in rad/s in soft_base at `time` s.

        Time that runs backwards begins anew, as after a restart of a replay.
        """
        if not self.options.enabled:
            return np.zeros(3)
        if not time > self._time:
            self._time = -math.inf
        share = lag_share(self._time, time, self.options.lag * self.period)
        began, self._time = self._time, time
        if not math.isfinite(began):
            self._rate = np.array(rate, dtype=float)
            return np.zeros(3)
        step = share * (rate - self._rate)
        self._rate = self._rate + step
        ax, ay, _ = (step / (time - began)).tolist()
        wx, wy, wz = self._rate.tolist()
        # - a x r - w x (w x r) at r = (0, 0, h)
        return self.height * np.array([-ay - wx * wz, ax - wy * wz, wx * wx + wy * wy])


def _height_and_period(model: RobotModel) -> tuple[float, float]:
    """Return h in m and T in s of the straight robot, as means over both directions across it."""
    stiffness = model.new_matrix()
    model.elements.assemble(np.zeros_like(model.mesh.nodes), stiffness)
    mass, along = model.nodal_weight[: model.n_free], model.mesh.nodes[: model.n_free, 2]
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
