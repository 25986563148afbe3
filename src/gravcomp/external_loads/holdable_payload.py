"""The heaviest payload that the cables can hold at the tip of a straight robot, whichever of its sides is below.

Tensions lambda and a force f at the tip move the tip of a straight robot across its axis by W lambda + C f (compliances of the
shape). The tensions up to T reach all moves whose part along any direction n is at most T sum_i max(0, n . W_i): so they hold the
weight m g d, for every direction d across the robot, if

    m g <= T sum_i max(0, n . W_i) / |C n|     for all n.

The robot's own weight is not in it: the bound is one that no robot exceeds while it is horizontal.
"""

import numpy as np

from gravcomp.full_model.shape import Shape
from gravcomp.standard_gravity import STANDARD_GRAVITY

_DIRECTIONS = 360


def holdable_payload(shape: Shape, tip_compliance: np.ndarray, tension_max: float) -> float:
    """Return the mass in kg. shape: of the straight robot without gravity; tip_compliance (3, 3) m/N there; tension_max in N."""
    across = np.linalg.svd(shape.tip_direction[None, :])[2][1:]  # (2, 3): two directions across the robot
    by_tension, by_force = across @ shape.response.compliance_ea[:3], across @ tip_compliance @ across.T
    angle = np.linspace(0.0, 2.0 * np.pi, _DIRECTIONS, endpoint=False)
    n = np.column_stack([np.cos(angle), np.sin(angle)])
    reached = tension_max * np.maximum(n @ by_tension, 0.0).sum(axis=1)
    return float((reached / np.linalg.norm(n @ by_force, axis=1)).min()) / STANDARD_GRAVITY
