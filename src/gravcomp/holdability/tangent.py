"""The smallest eigenvalue of the tangent stiffness on a path of equilibria.

    K(u, lambda) x = mu M x

with the mass M, so mu is the square of the lowest angular frequency; it is given over that of the robot at rest: 1 at rest, 0
where the robot buckles. K contains the stiffness of the cables at constant tension. Where the winches hold the cables instead,
the taut ones cannot change their length: mu is then the smallest value on the vectors with H x = 0. Both come from block
inverse iteration with a Rayleigh-Ritz projection (Bathe, Finite Element Procedures, section 11.6), started from the static
responses to gravity and to the cables. M does not depend on the shape; the stiffness at rest in its place would, because the
bending of a turned section is a stretch in the frame at rest.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from gravcomp.full_model.equilibrium import Equilibrium
from gravcomp.full_model.robot_model import RobotModel
from gravcomp.mechanics.block_matrix import BlockCholesky, NotPositiveDefinite

_ITERATIONS = 3
_TAUT = 1e-3  # of the largest tension
_DEPENDENT = 1e-8  # of the longest vector


class Eigenvalues(NamedTuple):
    """Smallest eigenvalues over those at rest: at constant tension, and with the taut cables held; 0: not stable."""

    free: float
    held: float


class Tangent:
    """The tangent stiffness of a model."""

    def __init__(self, model: RobotModel):
        self._model = model
        self._mass, self._matrix = model.mass_matrix().sparse(), model.new_matrix()
        model.elements.assemble(np.zeros_like(model.mesh.nodes), self._matrix)
        loads = [model.weight(axis) for axis in np.eye(3)]
        forces = model.tendons.state(model.mesh.nodes).force_jacobian
        factor = self._matrix.factor()
        self.answer = factor.solve(np.column_stack([*loads, *forces]))
        """(3 n_free, 3 + m): change of the unknowns at rest per unit of gravity along x, y, z and per tension of each cable."""
        self._begin = self._mass @ np.linalg.qr(self.answer)[0]
        self._rest = 1.0
        self._rest = self._iterated(factor, lambda y: y)

    def smallest(self, state: Equilibrium) -> Eigenvalues:
        """Return the smallest eigenvalues at a state."""
        model = self._model
        self._matrix.values[:] = 0.0
        model.elements.assemble(state.u, self._matrix)
        if state.tension.any():
            model.tendons.add_stiffness(state.tendons, state.tension, self._matrix)
        try:
            factor = self._matrix.factor()
        except NotPositiveDefinite:
            return Eigenvalues(0.0, 0.0)
        taut = state.tension > _TAUT * max(state.tension.max(initial=0.0), np.finfo(float).tiny)
        rows = state.tendons.jacobian[taut]
        release = factor.solve(state.tendons.force_jacobian[taut].T)
        compliance = rows @ release + np.diag(model.tendons.stretch(state.tendons)[taut])
        free = self._iterated(factor, lambda y: y)
        if not taut.any():
            return Eigenvalues(free, free)
        held = self._iterated(factor, lambda y: y - release @ np.linalg.solve(compliance, rows @ y))
        return Eigenvalues(free, held)

    def _iterated(self, factor: BlockCholesky, allowed: Callable[[np.ndarray], np.ndarray]) -> float:
        """Return the smallest eigenvalue among the vectors that `allowed` projects on; 0 if it is negative."""
        from scipy.linalg import eigh, qr

        right, value = self._begin, np.inf
        for _ in range(_ITERATIONS):
            y, triangle, order = qr(allowed(factor.solve(right)), mode="economic", pivoting=True)
            sizes = np.abs(np.diag(triangle))
            count = int((sizes > _DEPENDENT * sizes[0]).sum())  # the projection makes some vectors dependent
            y, triangle, right = y[:, :count], triangle[:count, :count], right[:, order[:count]]
            stiffness = np.linalg.solve(triangle.T, right.T @ y).T
            weighted = self._mass @ y
            values, vectors = eigh(0.5 * (stiffness + stiffness.T), y.T @ weighted)
            right, value = weighted @ vectors, float(values[0])
        return max(value / self._rest, 0.0)
