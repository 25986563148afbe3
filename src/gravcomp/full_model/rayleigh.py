"""Rayleigh damping, the force (alpha M + beta K) v, as in the article.

K is the stiffness of body and cables. That of the body alone is indefinite where cables under tension compress it beyond the
load at which it would buckle without them; as damping it would drive such a robot to flutter.
"""

import numpy as np

from gravcomp.cables.tendons import TendonState
from gravcomp.full_model.generalized_alpha import DynamicsOptions
from gravcomp.full_model.robot_model import RobotModel
from gravcomp.mechanics.block_matrix import BlockMatrix


class RayleighDamping:
    """The damping matrix alpha M + beta K, with the stiffness K of body and cables at the start of a step."""

    def __init__(self, model: RobotModel, mass: BlockMatrix, options: DynamicsOptions):
        self._model, self._mass, self._options = model, mass, options
        self._matrix = model.new_matrix()

    def update(self, u: np.ndarray, tension: np.ndarray, tendons: TendonState) -> None:
        """Set K to the tangent stiffness at the displacements u (n, 3).

        tension (m,) in N and tendons: of the cables at u.
        """
        self._matrix.values[:] = 0.0
        self._model.elements.assemble(u, self._matrix)
        if tension.any():
            self._model.tendons.add_stiffness(tendons, tension, self._matrix)
        self._matrix.values *= self._options.rayleigh_stiffness
        self._matrix.values += self._options.rayleigh_mass * self._mass.values

    def force(self, velocity: np.ndarray) -> np.ndarray:
        """Return the force (3 n_free,) in N for a velocity (3 n_free,)."""
        return self._matrix.multiply(velocity)

    def add_to(self, matrix: BlockMatrix, factor: float) -> None:
        """Add factor x damping matrix to `matrix`."""
        matrix.values += factor * self._matrix.values
