"""Following the equilibrium in reduced coordinates: the same Newton step as the full model's (`simulation.statics`), in
r unknowns.

    A = K(q) + K_cables(q, lambda),   A y = Phi^T f_weight - f(q),   A X = H^T,   W = H X,   dq = y + X lambda

with the tensions lambda from the cables' complementarity. One step follows a turning gravity; another is taken where
the correction that the last factor still gives moves the tip by more than the tolerance. All of it is one compiled function:
of many small calls a control step would spend more on calling than on computing.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numba import njit

from gravcomp.cables.slack import pivoted
from gravcomp.reduction.cholesky import factorise, solve
from gravcomp.reduction.reduced_cables import ReducedCables, ReducedTendons, add_stiffness, lacking, tendons_at
from gravcomp.reduction.reduced_model import ReducedModel
from gravcomp.reduction.strain_polynomials import strain_at, tangent
from gravcomp.simulation.statics import CableInput


@dataclass
class ReducedState:
    """q (r,), tension (m,), displacement (m,) of the cables' paths; compliance (m, m) and answer X^T (m, r) of the last step;
    residual (N): of the nodal forces out of balance, as far as the basis sees them, the norm, no less than the largest; converged."""

    q: np.ndarray
    tension: np.ndarray
    displacement: np.ndarray
    compliance: np.ndarray
    answer: np.ndarray
    residual: float = np.inf
    converged: bool = False


class _Body(NamedTuple):
    """What the compiled step reads of the model; tip (3, r) is how the tip moves with q."""

    linear: np.ndarray
    quadratic: np.ndarray
    force_norm: np.ndarray
    tip: np.ndarray


class _Point(NamedTuple):
    """At coordinates q: J^T (r, k) and strain (k,) of the elasticity, and the cables."""

    jacobian: np.ndarray
    strain: np.ndarray
    tendons: ReducedTendons


class ReducedTracker:
    """Owns the current reduced state."""

    def __init__(self, model: ReducedModel, length: float, tolerance: float = 5e-5, longest_step: float = 0.12, near: float = 0.02):
        """length (m) of the robot; tolerance, longest_step and near (the step up to which its own factor may judge it):
        displacement of the tip as a fraction of it."""
        self.model = model
        self._limits = longest_step * length, near * length, tolerance * length
        elasticity = model.elasticity
        self._body = _Body(elasticity.linear, elasticity.quadratic, model.force_norm, np.ascontiguousarray(model.section_change[-1, 0]))
        count = len(model.cables.rest_length)
        self._released, self._not_given = np.full(count, np.nan), np.zeros(0)
        self.place(np.zeros(model.size), np.zeros(count))

    def place(self, q: np.ndarray, tension: np.ndarray) -> None:
        """Start from the coordinates q (r,) under the tensions (m,)."""
        m = len(tension)
        self.state = ReducedState(q, tension, np.zeros(m), np.zeros((m, m)), np.zeros((m, q.size)))
        self._point = _point_at(self._body, self.model.cables, q)

    def track(self, gravity: np.ndarray, cables: CableInput, iterations: int = 4) -> ReducedState:
        """The state under gravity (3,) and the cables' input, from the present one; `converged` tells whether it was reached."""
        state, given = self.state, cables.tension
        wound = cables.wound if cables.wound is not None and given is None else self._released
        converged, point, *found = _followed(
            self._body, self.model.cables, self._point, state.q, state.tension, self.model.weight @ gravity,
            wound, self._not_given if given is None else given, iterations, *self._limits,
        )  # fmt: skip
        if not converged:
            return replace(state, residual=np.inf, converged=False)
        self._point = point
        self.state = ReducedState(*found, converged=True)
        return self.state


@njit(cache=True)
def _point_at(body, cables, q):
    jacobian, strain = strain_at(body.linear, body.quadratic, q)
    return _Point(jacobian, strain, tendons_at(cables, q))


@njit(cache=True, fastmath={"reassoc", "contract", "nsz", "arcp"})
def _followed(body, cables, point, q, tension, weight, wound, given, iterations, longest_step, near, tolerance):
    """Whether an equilibrium was reached, the point there, and the fields of its ReducedState up to the residual.

    wound (m,): displacements of the cables, NaN for released ones; given (m,): tensions that go first, or (0,).
    """
    m, r = len(tension), len(q)
    compliance, answer = np.zeros((m, m)), np.zeros((m, r))
    converged, residual = False, np.inf
    for _ in range(iterations):
        matrix = tangent(point.jacobian, body.quadratic, point.strain, 1.0)
        add_stiffness(cables, point.tendons, tension, matrix)
        definite, factor = factorise(matrix)
        if not definite:
            break
        columns = np.empty((r, m + 4))
        columns[:, 0] = weight - point.jacobian @ point.strain
        columns[:, 1 : m + 1] = point.tendons.jacobian.T
        columns[:, m + 1 :] = body.tip.T
        solve(factor, columns)
        solved = np.ascontiguousarray(columns.T)
        y, answer, of_tip = solved[0], solved[1 : m + 1], solved[m + 1 :]
        compliance = point.tendons.jacobian @ answer.T
        for i in range(m):
            compliance[i, i] += cables.axial_compliance[i]
        if len(given):
            wanted = given
        else:
            lack, held = wound - point.tendons.displacement - point.tendons.jacobian @ y, np.isfinite(wound)
            wanted = pivoted(compliance, lack, held, held & (tension > 0.0))
        step = y + answer.T @ wanted
        size = np.sqrt(((body.tip @ step) ** 2).sum())
        if not np.isfinite(size):
            break
        share = min(1.0, longest_step / size) if size > 0.0 else 1.0
        q, tension = q + share * step, tension + share * (wanted - tension)
        point = _point_at(body, cables, q)
        out = weight - point.jacobian @ point.strain + tension @ point.tendons.jacobian
        pull = np.zeros(m) if len(given) else lacking(cables, point.tendons, tension, compliance, wound)
        left = of_tip @ out + body.tip @ (answer.T @ pull)
        if size < near and (left**2).sum() < tolerance**2:
            converged, residual = True, np.sqrt(out @ (body.force_norm @ out))
            break
    displacement = point.tendons.displacement + cables.axial_compliance * tension
    return converged, point, q, tension, displacement, compliance, answer, residual
