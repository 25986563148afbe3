"""Viscous stress of the materials in motion: Kelvin-Voigt damping and one Maxwell branch that creeps.

    S = S_elastic(E) + C : (beta dE/dt + rho H),      dH/dt = dE/dt - H / T,

H is the strain that the branch still holds: the body is stiffer by the fraction rho at first, and that stiffness creeps away
within some T. Over a step of length h the rate of strain is the second backward difference, dE/dt = (3 E_(n+1) - 4 E_n +
E_(n-1)) / (2 h), and H follows from a constant rate,

    H_(n+1) = e^-x H_n + g (E_(n+1) - E_n),      x = h / T,   g = (1 - e^-x) / x,

so both are linear in the strain at the end of the step, as `ViscousStrain` needs.
"""

from typing import TypeVar

import numpy as np

from gravcomp.mechanics.viscous_strain import ViscousStrain
from gravcomp.mesh import Mesh

_Time = TypeVar("_Time", float, np.ndarray)


class Viscosity:
    """Damping and creep of a mesh's k elements. creeps: whether any of them has a creep branch."""

    def __init__(self, mesh: Mesh):
        def of(name: str) -> np.ndarray:
            return np.array([getattr(material, name) for material in mesh.materials])[mesh.region][:, None, None]

        self._damping_time, self._ratio, self._creep_time = of("damping_time"), of("creep_ratio"), of("creep_time")
        self.creeps = bool(self._ratio.any())

    def step(self, strain: np.ndarray, strain_before: np.ndarray | None, held: np.ndarray, h: float) -> ViscousStrain:
        """Return the viscous strain at the end of a step of h s from `strain` and `held` (k, p, 6).

        strain_before (k, p, 6): h s earlier; None: unknown, the rate of strain is then the first difference.
        """
        if strain_before is None:
            rate, past = 1.0 / h, strain / h
        else:
            rate, past = 1.5 / h, (4.0 * strain - strain_before) / (2.0 * h)
        factor, past = rate * self._damping_time, self._damping_time * past
        if self.creeps:
            decay, gain = branch(h, self._creep_time)
            factor = factor + self._ratio * gain
            past = past + self._ratio * (gain * strain - decay * held)
        return ViscousStrain(factor[:, 0, 0], past)

    def held_after(self, strain: np.ndarray, strain_before: np.ndarray, held: np.ndarray, h: float) -> np.ndarray:
        """Return the held strain (k, p, 6) after a step of h s from `strain_before` and `held` to `strain`."""
        if not self.creeps:
            return held
        decay, gain = branch(h, self._creep_time)
        return decay * held + gain * (strain - strain_before)


def branch(h: float, creep_time: _Time) -> tuple[_Time, _Time]:
    """Return e^-x and g for a step of h s."""
    x = h / creep_time
    return np.exp(-x), -np.expm1(-x) / x
