"""How measured tip and tensions depend on a load at the tip and on the model's errors, near one shape of the model.

The winches hold the displacements u. With the force f at the tip, the compliance C of the tip under it, and W_af = W_ea^T, as the
body is elastic (Maxwell 1864),

    u <= W_aa lambda + W_af f + delta_g,   lambda >= 0, complementary,      e = W_ea lambda + C f + e_g.

A load makes cables slack, and the robot is softer without them. So tensions and tip are those of the taut cables under the load
that is assumed, and the derivatives d lambda = -W_aa^-1 W_af df, de = (C - W_ea W_aa^-1 W_af) df hold for these. A weight that is
larger by the share s_w acts like more of delta_g and e_g. A body that is more compliant by the share s_E has all three W and C
larger by it: it keeps the tensions of a straight robot, whose cables carry its weight whatever its stiffness, and moves the tip
as more weight does. Where the robot is bent far this holds for the tangent: a body with less stress is out of balance by s_E of
all forces on it, which moves tip and cables by what its compliance makes of them. Displacements that differ from the commanded
ones by b_u (backlash, friction, line) give d lambda = W_aa^-1 b_u and de = W_ea W_aa^-1 b_u.
"""

from typing import NamedTuple

import numpy as np

from gravcomp.cables.slack import pivoted
from gravcomp.full_model.shape import Shape


class Sensitivity(NamedTuple):
    """Tip and tensions under a load, as changes of the model's, and their derivatives. Slack cables have rows of zeros.

    tip (3,) m and tension (m,) N; tip_force (3, 3) m/N, tip_error (3,) m by s_E and by s_w alike, tip_cables (3, m);
    tension_force (m, 3), tension_stiffness and tension_weight (m,) N, tension_cables (m, m) N/m; taut (m,).
    """

    tip: np.ndarray
    tension: np.ndarray
    tip_force: np.ndarray
    tip_error: np.ndarray
    tip_cables: np.ndarray
    tension_force: np.ndarray
    tension_stiffness: np.ndarray
    tension_weight: np.ndarray
    tension_cables: np.ndarray
    taut: np.ndarray


class HeldRobot:
    """The linear response of a shape whose winches hold their displacements."""

    def __init__(
        self,
        shape: Shape,
        tip_compliance: np.ndarray,
        wound: np.ndarray | None,
        rest_tip: np.ndarray,
        by_loads: tuple[np.ndarray, np.ndarray] | None = None,
    ):
        """tip_compliance (3, 3) m/N at given tensions; wound (m,) m, None: released; rest_tip (3,) m: without any load.

        by_loads: what all loads but the cables move the tip (3,) m and the cables (m,) m in the shape's tangent, at given
        tensions; None: what they have moved them from rest, which is the same where the robot is little bent.
        """
        self._shape, self._tip_compliance = shape, tip_compliance
        self._wound = np.full(len(shape.cable_tension), np.nan) if wound is None else wound
        from_rest = shape.response.effector_free[:3] - rest_tip, shape.response.displacement_free
        tip, cables = from_rest if by_loads is None else by_loads
        self._tip_by_loads: np.ndarray = tip
        self._cables_by_loads: np.ndarray = cables
        self._inverse: tuple[np.ndarray, np.ndarray] | None = None  # of the taut cables' compliance, for these cables

    def by_winding(self, before: "HeldRobot") -> tuple[np.ndarray, np.ndarray]:
        """Return what the winches have changed since another shape: of the tip (3,) in m and of the tensions (m,) in N."""
        wound, here = np.nan_to_num(self._wound - before._wound), self.under(np.zeros(3))
        return here.tip_cables @ wound, here.tension_cables @ wound

    def under(self, force: np.ndarray) -> Sensitivity:
        """Return what another force (3,) in N than the model's changes."""
        response, before = self._shape.response, self._shape.cable_tension
        compliance = np.ascontiguousarray(response.compliance_aa)
        to_tip, held = response.compliance_ea[:3], np.isfinite(self._wound)
        lack = np.where(held, self._wound - response.displacement_free - to_tip.T @ force, 0.0)
        tension = pivoted(compliance, lack, held, held & (before > 0.0))
        taut = tension > 0.0
        m = len(taut)
        by_force, stiffness, weight, cables = np.zeros((m, 3)), np.zeros(m), np.zeros(m), np.zeros((m, m))
        if taut.any():
            if self._inverse is None or (self._inverse[0] != taut).any():  # an iteration seldom changes which cables are taut
                self._inverse = taut, np.linalg.pinv(compliance[np.ix_(taut, taut)], rcond=1e-9)
            inverse = self._inverse[1]
            cables[np.ix_(taut, taut)] = inverse
            by_force[taut] = -inverse @ to_tip[:, taut].T
            weight[taut] = -inverse @ (self._cables_by_loads + to_tip.T @ force)[taut]
            stiffness[taut] = weight[taut] - tension[taut]
        return Sensitivity(
            tip=self._tip_compliance @ force + to_tip @ (tension - before),
            tension=tension - before,
            tip_force=self._tip_compliance + to_tip @ by_force,
            tip_error=self._tip_by_loads + self._tip_compliance @ force + to_tip @ weight,
            tip_cables=to_tip @ cables,
            tension_force=by_force,
            tension_stiffness=stiffness,
            tension_weight=weight,
            tension_cables=cables,
            taut=taut,
        )
