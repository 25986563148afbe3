"""How measured tip and tensions depend on a load at the tip and on the model's errors, at one shape of the model.

The winches hold the displacements u of the taut cables. With the force f at the tip, the compliance C of the tip under it, and W_af
= W_ea^T, as the body is elastic (Maxwell 1864),

    u = W_aa lambda + W_af f + delta_g,      e = W_ea lambda + C f + e_g,

so that d lambda = -W_aa^-1 W_af df and de = (C - W_ea W_aa^-1 W_af) df. A weight that is larger by the share s_w acts like more of
delta_g and e_g. A body that is more compliant by the share s_E has all three W and C larger by it: it keeps the tensions of a
straight robot, whose cables carry its weight whatever its stiffness, and moves the tip as more weight does. Displacements that
differ from the commanded ones by b_u (backlash, friction, line) give d lambda = W_aa^-1 b_u and de = W_ea W_aa^-1 b_u.
"""

from typing import NamedTuple

import numpy as np

from gravcomp.full_model.shape import Shape


class Sensitivity(NamedTuple):
    """Derivatives: tip_force (3, 3) m/N, tip_error (3,) m; tension_force (m, 3), tension_stiffness and tension_weight (m,) N.

    tip_error: by s_E and by s_w alike. tip_cables (3, m) and tension_cables (m, m) N/m: by the displacements of the cables. Cables that are not taut have rows of zeros. taut (m,).
    """

    tip_force: np.ndarray
    tip_error: np.ndarray
    tension_force: np.ndarray
    tension_stiffness: np.ndarray
    tension_weight: np.ndarray
    tip_cables: np.ndarray
    tension_cables: np.ndarray
    taut: np.ndarray


def sensitivity(shape: Shape, tip_compliance: np.ndarray, rest_tip: np.ndarray) -> Sensitivity:
    """Return the derivatives at a shape; tip_compliance (3, 3) in m/N at given tensions; rest_tip (3,) m: without any load."""
    response, taut = shape.response, shape.cable_tension > 0.0
    m = len(taut)
    to_tip = response.compliance_ea[:3]
    free = response.effector_free[:3] - rest_tip
    force, stiffness, weight, cables = np.zeros((m, 3)), np.zeros(m), np.zeros(m), np.zeros((m, m))
    if taut.any():
        inverse = np.linalg.pinv(response.compliance_aa[np.ix_(taut, taut)], rcond=1e-9, hermitian=False)
        cables[np.ix_(taut, taut)] = inverse
        force[taut] = -inverse @ to_tip[:, taut].T
        weight[taut] = -inverse @ response.displacement_free[taut]
        stiffness[taut] = weight[taut] - shape.cable_tension[taut]
    return Sensitivity(
        tip_force=tip_compliance + to_tip @ force,
        tip_error=free + to_tip @ weight,
        tension_force=force,
        tension_stiffness=stiffness,
        tension_weight=weight,
        tip_cables=to_tip @ cables,
        tension_cables=cables,
        taut=taut,
    )
