"""Following the equilibrium in reduced coordinates: the same Newton step as the full model's (`simulation.statics`), in
r unknowns.

    A = K(q) + K_cables(q, lambda),   A y = Phi^T f_weight - f(q),   A X = H^T,   W = H X,   dq = y + X lambda

with the tensions lambda from the cables' complementarity. One step follows a turning gravity; another is taken where
the correction that the last factor still gives moves the tip by more than the tolerance.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg.lapack import dpotrf, dpotrs

from gravcomp.reduction.reduced_cables import ReducedCables
from gravcomp.reduction.reduced_model import ReducedModel
from gravcomp.simulation.statics import CableInput


@dataclass
class ReducedState:
    """q (r,), tension (m,), displacement (m,) of the cables' paths; compliance (m, m) and answer X (r, m) of the last step;
    residual (N): of the nodal forces out of balance, as far as the basis sees them, the norm, no less than the largest; converged."""

    q: np.ndarray
    tension: np.ndarray
    displacement: np.ndarray
    compliance: np.ndarray
    answer: np.ndarray
    residual: float = np.inf
    converged: bool = False


class ReducedTracker:
    """Owns the current reduced state and its stiffness."""

    def __init__(self, model: ReducedModel, length: float, tolerance: float = 5e-5, longest_step: float = 0.12, near: float = 0.02):
        """length (m) of the robot; tolerance, longest_step and near (the step up to which its own factor may judge it):
        displacement of the tip as a fraction of it."""
        self.model = model
        self._tolerance = tolerance * length
        self._longest_step = longest_step * length
        self._near = near * length
        r, m = model.size, len(model.rest_length)
        self._tip = model.section_change[-1, 0]
        self._cables = ReducedCables(model)
        self.place(np.zeros(r), np.zeros(m))

    def place(self, q: np.ndarray, tension: np.ndarray) -> None:
        """Start from the coordinates q (r,) under the tensions (m,)."""
        m = len(self.model.rest_length)
        self.state = ReducedState(q, tension, np.zeros(m), np.zeros((m, m)), np.zeros((q.size, m)))
        self._refresh(q)

    def track(self, gravity: np.ndarray, cables: CableInput, iterations: int = 4) -> ReducedState:
        """The state under gravity (3,) and the cables' input, from the present one; `converged` tells whether it was reached."""
        model, state = self.model, self.state
        weight = model.weight @ gravity
        q, tension = state.q, state.tension
        converged = False
        for _ in range(iterations):
            matrix = self._stiffness.copy().T  # column-major, as LAPACK factorises in place; it is symmetric
            matrix = self._cables.stiffness_added(matrix, self._tendons, tension)
            factor, info = dpotrf(matrix, lower=1, clean=0, overwrite_a=1)
            if info:
                break
            right = np.empty((q.size, 1 + tension.size), order="F")
            right[:, 0], right[:, 1:] = weight - self._force, self._tendons.jacobian.T
            solved, _ = dpotrs(factor, right, lower=1, overwrite_b=1)
            y, answer = solved[:, 0], solved[:, 1:]
            compliance = self._tendons.jacobian @ answer
            compliance.ravel()[:: len(compliance) + 1] += model.axial_compliance
            wanted = cables.tensions(compliance, self._tendons.displacement + self._tendons.jacobian @ y, tension > 0.0)
            step = y + answer @ wanted
            moved = self._tip @ step
            size = float(np.sqrt(moved @ moved))
            if not np.isfinite(size):
                break
            share = min(1.0, self._longest_step / size) if size > 0.0 else 1.0
            q, tension = q + share * step, tension + share * (wanted - tension)
            self._refresh(q)
            out = weight - self._force + tension @ self._tendons.jacobian
            lacking = self._cables.lacking(self._tendons, tension, compliance, cables)
            left = self._tip @ (dpotrs(factor, out, lower=1)[0] + answer @ lacking)
            converged = size < self._near and bool(left @ left < self._tolerance**2)
            if converged:
                break
        else:
            converged = False
        if not converged:
            self._refresh(state.q)
            return state_failed(state)
        displacement = self._tendons.displacement + model.axial_compliance * tension
        residual = float(np.sqrt(out @ model.force_norm @ out))
        self.state = ReducedState(q, tension, displacement, compliance, answer, residual, True)
        return self.state

    def _refresh(self, q: np.ndarray) -> None:
        """Forces, stiffness and cables at q."""
        self._force, self._stiffness, _ = self.model.elasticity.evaluate(q)
        self._tendons = self._cables.state(q)


def state_failed(state: ReducedState) -> ReducedState:
    """The last state, marked as not converged."""
    return ReducedState(state.q, state.tension, state.displacement, state.compliance, state.answer, np.inf, False)
