"""The material laws by name, and the compiled functions that call the law of an element.

To add a law:

1. A file in this folder with compiled `stress(constants, e, s, d, tangent)` and `energy(constants, e)`, and the equation and
   its source in the docstring. `constants` are lambda and mu of small strain, then the law's own constants.
2. Here: an entry in `LAWS`, and a branch in `stress` and in `energy`.
3. In `description/body.py`: the name in the choices of `law`, and a field for each constant of the law's own, which
   `OWN_CONSTANTS` lists. These are ratios to the stiffness at small strain, so that one Young's modulus scales the whole law;
   a reduction needs that too.

`test/test_mechanics.py` checks the derivatives of every law in `LAWS`.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from gravcomp.description.body import OWN_CONSTANTS
from gravcomp.materials import mooney_rivlin, neo_hookean, st_venant_kirchhoff, yeoh
from gravcomp.rounding import REORDERED


class Law(NamedTuple):
    """Properties of a law.

    code: its number in compiled functions; quadratic: whether the stress is linear in Green's strain, so that polynomials of
    the strain are the whole reduced elasticity; softening_strain: Green's strain of a compressed fibre below which the force on
    it falls, None: nowhere; own_constants: names of the fields of `description.Material` that are the law's own constants.
    """

    code: int
    quadratic: bool = False
    softening_strain: float | None = None
    own_constants: tuple[str, ...] = ()


LAWS = {
    "svk": Law(0, quadratic=True, softening_strain=st_venant_kirchhoff.SOFTENING_STRAIN),
    "neo_hookean": Law(1),
    "mooney_rivlin": Law(2, own_constants=OWN_CONSTANTS["mooney_rivlin"]),
    "yeoh": Law(3, own_constants=OWN_CONSTANTS["yeoh"]),
}


@njit(cache=True, fastmath=REORDERED)
def stress(law: int, constants: np.ndarray, e: np.ndarray, s: np.ndarray, d: np.ndarray, tangent: bool) -> None:
    """Second Piola-Kirchhoff stress into s (6) for Green's strain e (6), and dS/dE into d (6, 6) if `tangent`.

    law: code of the law; constants (c,): a row of `MaterialConstants.values`.
    """
    if law == 0:
        st_venant_kirchhoff.stress(constants, e, s, d, tangent)
    elif law == 1:
        neo_hookean.stress(constants, e, s, d, tangent)
    elif law == 2:
        mooney_rivlin.stress(constants, e, s, d, tangent)
    else:
        yeoh.stress(constants, e, s, d, tangent)


@njit(cache=True, fastmath=REORDERED)
def energy(law: int, constants: np.ndarray, e: np.ndarray) -> float:
    """Energy density in J/m^3 for Green's strain e (6); arguments as in `stress`."""
    if law == 0:
        return st_venant_kirchhoff.energy(constants, e)
    if law == 1:
        return neo_hookean.energy(constants, e)
    if law == 2:
        return mooney_rivlin.energy(constants, e)
    return yeoh.energy(constants, e)
