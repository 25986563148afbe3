"""Strain whose linear stress is that of damping and creep: C : (factor E - past), added to the elastic stress in motion.

C is the stiffness of small strain, or its part without change of volume (see `assembly`); `full_model.viscosity` computes factor
and past from the strains of the steps before. The law sees strain alone, so it does not brake a rotating body, and the tangent
stays symmetric and exact.
"""

import dataclasses

import numpy as np
from numba import njit

from gravcomp.materials.linear import add_linear_stress
from gravcomp.rounding import REORDERED


@dataclasses.dataclass(frozen=True)
class ViscousStrain:
    """factor (k,) of the present strain of each element, past (k, p, 6) to subtract at each quadrature point.

    damped (k,): whether damping is in both; if not, they are those of creep alone.
    """

    factor: np.ndarray
    past: np.ndarray
    damped: np.ndarray


@njit(cache=True, fastmath=REORDERED)
def add_viscous_stress(factor: float, past: np.ndarray, first: float, shear: float, e: np.ndarray, s: np.ndarray) -> None:
    """Add the stress of damping and creep at one point to s (6).

    past (6); e (6): Green's strain; first, shear: Lame's constants of C in Pa.
    """
    viscous = np.empty(6)
    for m in range(6):
        viscous[m] = factor * e[m] - past[m]
    add_linear_stress(first, shear, viscous, s)
