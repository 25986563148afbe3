"""Viscous stress of the materials: Kelvin-Voigt damping, and Maxwell branches that creep and relax.

    S = S_elastic(E) + C : (beta dE/dt + sum_i rho_i H_i),      dH_i/dt = dE/dt - H_i / T_i,

H_i is the strain that branch i still holds: the body is stiffer by the fraction rho_i at first, and that stiffness relaxes
within some T_i. This is finite linear viscoelasticity with the linear law in the branches (J. C. Simo, Comput. Methods Appl.
Mech. Eng. 60, 1987; G. A. Holzapfel, Nonlinear Solid Mechanics, 2000, section 6.10). A Prony series of shares g_i of the
instantaneous stiffness has rho_i = g_i / (1 - sum g). C has at most the lambda of Poisson's ratio 0.45 (`mechanics.assembly`).
Over a step of length h the rate of strain is the second backward difference, dE/dt = (3 E_(n+1) - 4 E_n + E_(n-1)) / (2 h), and
H follows from a constant rate,

    H_(n+1) = e^-x H_n + a (E_(n+1) - E_n),      x = h / T,   a = (1 - e^-x) / x,

so both are linear in the strain at the end of the step, as `ViscousStrain` needs. A body at rest creeps by the same branches
without the damping: its shape is the equilibrium in which the branches hold H_(n+1).
"""

from typing import TypeVar

import numpy as np

from gravcomp.mechanics.viscous_strain import ViscousStrain
from gravcomp.mesh import Mesh

_Time = TypeVar("_Time", float, np.ndarray)


class Viscosity:
    """Damping and the b branches of a mesh's k elements. creeps: whether there are any branches.

    The strains that the branches hold are arrays (b, k, p, 6).
    """

    def __init__(self, mesh: Mesh):
        damping = np.array([material.damping_time for material in mesh.materials])
        count = max(len(material.branches) for material in mesh.materials)
        # A material with fewer branches than another one has branches without stiffness.
        branches = np.array([material.branches + ((0.0, 1.0),) * (count - len(material.branches)) for material in mesh.materials])
        branches = branches.reshape(len(mesh.materials), count, 2)
        self._damping_time = damping[mesh.region][:, None, None]
        self._ratio, self._time = (branches[mesh.region, :, i].T[:, :, None, None] for i in range(2))
        self.creeps = count > 0
        self._creeping = self._ratio > 0.0

    def set_ratio(self, ratio: np.ndarray) -> None:
        """Give every material that has branches the ratios (b,) in place of its own."""
        self._ratio = np.where(self._creeping, ratio[:, None, None, None], 0.0)

    def step(self, strain: np.ndarray, strain_before: np.ndarray | None, held: np.ndarray, h: float) -> ViscousStrain:
        """Return the viscous strain at the end of a step of h s from `strain` (k, p, 6) and `held`, in motion.

        strain_before (k, p, 6): h s earlier; None: unknown, the rate of strain is then the first difference.
        """
        if strain_before is None:
            rate, past = 1.0 / h, strain / h
        else:
            rate, past = 1.5 / h, (4.0 * strain - strain_before) / (2.0 * h)
        creep = self.creep(strain, held, h)
        damping_time = self._damping_time[:, 0, 0]
        return ViscousStrain(creep.factor + rate * damping_time, creep.past + self._damping_time * past, damping_time > 0.0)

    def creep(self, strain: np.ndarray, held: np.ndarray, h: float) -> ViscousStrain:
        """Return the viscous strain at the end of a step of h s from `strain` (k, p, 6) and `held`, at rest."""
        decay, gain = branch(h, self._time)
        past = (self._ratio * (gain * strain - decay * held)).sum(axis=0) if self.creeps else np.zeros_like(strain)
        factor = (self._ratio * gain).sum(axis=0)[:, 0, 0]
        return ViscousStrain(factor, past, np.zeros(len(factor), bool))

    def relaxed(self, strain: np.ndarray) -> np.ndarray:
        """Return what the branches hold when they have relaxed: zeros (b, k, p, 6) for the strain (k, p, 6)."""
        return np.zeros((len(self._ratio), *strain.shape))

    def held_after(self, strain: np.ndarray, strain_before: np.ndarray, held: np.ndarray, h: float) -> np.ndarray:
        """Return the held strain after a step of h s from `strain_before` and `held` to `strain` (k, p, 6)."""
        if not self.creeps:
            return held
        decay, gain = branch(h, self._time)
        return decay * held + gain * (strain - strain_before)


def branch(h: float, time: _Time) -> tuple[_Time, _Time]:
    """Return e^-x and a for a step of h s."""
    x = h / time
    return np.exp(-x), -np.expm1(-x) / x
