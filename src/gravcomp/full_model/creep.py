"""Creep of a robot at rest: what the branches of its materials (`viscosity`) hold from one equilibrium to the next."""

import numpy as np

from gravcomp.full_model.robot_model import RobotModel
from gravcomp.full_model.viscosity import Viscosity
from gravcomp.mechanics.corotational import CorotationalElements
from gravcomp.mechanics.viscous_strain import ViscousStrain


class Creep:
    """Memory of the full model.

    strain (k, p, 6) of the last equilibrium, held (b, k, p, 6) by the branches. `exists`: whether a material has branches;
    corotational tetrahedra have none.
    """

    def __init__(self, model: RobotModel):
        """Start with the straight robot, relaxed."""
        self._elements = None if isinstance(model.elements, CorotationalElements) else model.elements
        self._viscosity = Viscosity(model.mesh)
        self.exists = self._elements is not None and self._viscosity.creeps
        self.relax(np.zeros_like(model.mesh.nodes))

    def set_ratio(self, ratio: np.ndarray) -> None:
        """Give every material that creeps branches of these ratios (b,), stiffness over the long-term one."""
        self._viscosity.set_ratio(ratio)

    def relax(self, u: np.ndarray) -> None:
        """Be relaxed at the displacements u (n, 3): as after a long time there."""
        if self.exists and self._elements is not None:
            self.strain = self._elements.strains(u)
            self.held = self._viscosity.relaxed(self.strain)

    def step(self, h: float) -> ViscousStrain:
        """Return the viscous strain at the end of a step of h s."""
        return self._viscosity.creep(self.strain, self.held, h)

    def advance(self, u: np.ndarray, h: float) -> None:
        """Take the equilibrium u (n, 3) as that at the end of a step of h s."""
        assert self._elements is not None
        strain = self._elements.strains(u)
        self.held = self._viscosity.held_after(strain, self.strain, self.held, h)
        self.strain = strain
