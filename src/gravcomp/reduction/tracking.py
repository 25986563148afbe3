"""Tracking of the equilibrium in reduced coordinates, with the Newton step of `full_model.tracking` in r unknowns.

    A = K(q) + K_cables(q, lambda),   A y = Phi^T f_weight - f(q),   A X = H^T,   W = H X,   dq = y + X lambda

with the tensions lambda from the cables' complementarity. Creep adds a stress that is linear in the strain (`memory`). One step
is enough to track a turning gravity; another is taken if the correction with the last factor moves the tip by more than the
tolerance.

A straight step along a curved path stretches a body: its stress says little about that of the equilibrium, and with it the
stiffness may be eight times too large after a step of 3 % of the length. So the stiffness at a shape takes the stress that the
step to it expected, eps + J dq from the shape before, as in the full model (Magisano, Leonetti and Garcea 2017). It is kept from
one call to the next: a step that is good enough for the tip may leave such a stretch. For a law that is not quadratic in the
strain it is the stress of the shape, and the W that is returned is never that of a shape to which a long step has led.

All of it is one compiled function: with many small calls, a control step would spend more time on calling than on computing.
"""

from dataclasses import dataclass, replace

import numpy as np
from numba import njit

from gravcomp.cables.friction import Sliding
from gravcomp.cables.slack import pivoted
from gravcomp.full_model.cable_input import CableInput
from gravcomp.mechanics.block_matrix import NotPositiveDefinite
from gravcomp.reduction.body import Body, Point, body_of, elastic_force, kept_stiffness, point_at, stiffness_factor
from gravcomp.reduction.cholesky import solve
from gravcomp.reduction.contact import ReducedContact
from gravcomp.reduction.contact_step import tracked_touching
from gravcomp.reduction.law_deviation import KeptStiffness, forget
from gravcomp.reduction.reduced_cables import lacking, stretch
from gravcomp.reduction.reduced_model import ReducedModel
from gravcomp.rounding import REORDERED

# Displacements of the tip as fractions of the length: the longest step, the largest one whose factor may decide on convergence,
# what may be left then, and the largest step of a law that leads near enough to an equilibrium for the stiffness there.
_LONGEST_STEP, _NEAR, _TOLERANCE, _CALM = 0.05, 0.02, 5e-5, 5e-4


@dataclass
class ReducedState:
    """State of the reduced model, with the compliance of the last step.

    q (r,); tension (m,) in N; displacement (m,) of the cables' paths in m; compliance (m, m) in m/N; answer X^T (m, r); residual:
    norm of the nodal forces out of balance in N, as far as the basis represents them; it is not less than the largest of them.
    """

    q: np.ndarray
    tension: np.ndarray
    displacement: np.ndarray
    compliance: np.ndarray
    answer: np.ndarray
    residual: float = np.inf
    converged: bool = False


class ReducedTracker:
    """Tracks the equilibrium of a reduced model. Owns the current `state`, and the `sliding` of the cables."""

    def __init__(self, model: ReducedModel, length: float):
        """Start from the straight robot of `length` m."""
        self.model, self._length = model, length
        self._body = body_of(model)
        calm = _CALM * length if len(self._body.deviation.weight) else np.inf
        self._limits = _LONGEST_STEP * length, _NEAR * length, _TOLERANCE * length, calm
        self._kept = kept_stiffness(model)
        self._has_friction = bool(model.cables.friction.any())
        self._no_offset = np.zeros(model.elasticity.linear.shape[1])
        self.place(np.zeros(model.size), np.zeros(len(model.cables.rest_length)))

    contact: ReducedContact | None = None
    """With the obstacles of a scene; None: nothing is in the way."""

    def place(self, q: np.ndarray, tension: np.ndarray, sliding: Sliding | None = None) -> None:
        """Start from the coordinates q (r,) under the tensions (m,). sliding: of the cables, default none."""
        m = len(tension)
        self.sliding = sliding or Sliding.none(m, self._length)
        self.state = ReducedState(q, tension, np.zeros(m), np.zeros((m, m)), np.zeros((m, q.size)))
        self._point = point_at(self._body, q, self.sliding.direction)
        self._expected = self._point.strain
        if self.contact is not None:
            self.contact.forget()

    @property
    def strain(self) -> np.ndarray:
        """Strain (k,) of the elasticity at the present state."""
        return self._point.strain

    def track(
        self,
        gravity: np.ndarray,
        cables: CableInput,
        iterations: int = 4,
        creep: tuple[float, np.ndarray] | None = None,
        force: np.ndarray | None = None,
    ) -> ReducedState:
        """Return the state under gravity (3,) and the cables' input, tracked from the present one; see its `converged`.

        creep: of `Memory.stress`; None: the branches have relaxed. force (r,): acts in addition to the weight.
        """
        stiffer, offset = creep or (0.0, self._no_offset)
        state = self.state
        if self._has_friction:
            stretched = stretch(self._body.cables, self._point.tendons) * state.tension
            self.sliding = cables.sliding(self.sliding, state.tension, self._point.tendons.displacement + stretched)
        wound, given = cables.arrays(state.tension.size)
        weight = self.model.weight @ gravity
        if force is not None:
            weight = weight + force
        contact, stiffness = self.contact, (1.0 + stiffer, offset)
        if contact is not None and not contact.clear.far:
            return self._touching(gravity, weight, wound, given, *stiffness, iterations)
        converged, point, expected, q, tension, displacement, compliance, answer, residual = _tracked(
            self._body,
            self._point,
            self._expected,
            state.q,
            state.tension,
            weight,
            wound,
            given,
            self.sliding.direction,
            *stiffness,
            self._kept,
            iterations,
            *self._limits,
        )
        if contact is not None and not (converged and contact.clear.stays_far(state.q, q, gravity)):
            return self._touching(gravity, weight, wound, given, *stiffness, iterations)
        self._point, self._expected = point, expected
        if not converged:
            return replace(state, residual=np.inf, converged=False)
        self.state = ReducedState(q, tension, displacement, compliance, answer, residual, True)
        return self.state

    def tip_compliance(self) -> np.ndarray:
        """Return the displacement of the tip (3, 3) m/N by forces on it at given tensions, at the present state.

        Raises NotPositiveDefinite where the state is not stable.
        """
        body, point, state = self._body, self._point, self.state
        definite, factor = stiffness_factor(body, point, state.q, state.tension, self._expected, 1.0, self._kept)
        if not definite:
            raise NotPositiveDefinite("the reduced stiffness is not positive definite")
        columns = body.tip.T.copy()
        solve(factor, columns)
        compliance: np.ndarray = body.tip @ columns
        return compliance

    def _touching(
        self, gravity: np.ndarray, weight: np.ndarray, wound: np.ndarray, given: np.ndarray, scale: float, offset: np.ndarray,
        iterations: int,
    ) -> ReducedState:  # fmt: skip
        """Return the state as `track` does, with contact."""
        assert self.contact is not None
        state, (longest, near, tolerance, calm) = self.state, self._limits
        touching = self.contact.touching(state.q, gravity)
        longest = min(longest, touching.surface.radius.min())
        (
            converged, self._point, self._expected, q, tension, displacement, compliance, answer, residual, pressed,
        ) = tracked_touching(
            self._body, self._point, self._expected, state.q, state.tension, weight, wound, given, self.sliding.direction, scale,
            offset, self._kept, iterations, longest, min(longest, near), tolerance, calm, touching,
        )  # fmt: skip
        if not converged:
            return replace(state, residual=np.inf, converged=False)
        self.contact.keep(touching, pressed)
        if not len(pressed.row):
            self.contact.clear.look(q, gravity)
        self.state = ReducedState(q, tension, displacement, compliance, answer, residual, True)
        return self.state


@njit(cache=True, fastmath=REORDERED)
def _tracked(
    body: Body, point: Point, expected: np.ndarray, q: np.ndarray, tension: np.ndarray, weight: np.ndarray, wound: np.ndarray,
    given: np.ndarray, pulling: np.ndarray, scale: float, offset: np.ndarray, kept: KeptStiffness,
    iterations: int, longest_step: float, near: float, tolerance: float, calm: float,
) -> tuple[bool, Point, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, float]:  # fmt: skip
    """Return whether an equilibrium was reached, the point there and the strain expected there, and the fields of `ReducedState`.

    Where none was reached, point and expected strain (k,) are those of the start. wound and given: of `CableInput.arrays`;
    pulling (m,): of `tendons_at`; scale and offset (k,): the stress is scale eps + offset; kept: of `elastic_stiffness`; the last
    four in m.
    """
    m, r, start, expected_first, cables = len(tension), len(q), point, expected, body.cables
    compliance, answer = np.zeros((m, m)), np.zeros((m, r))
    converged, residual, before = False, np.inf, 0.0
    of_law = len(body.deviation.weight) > 0
    for iteration in range(iterations):
        stress = scale * point.strain + offset
        if iteration:  # with that of another shape the steps may not come to an end
            forget(kept)
        definite, factor = stiffness_factor(body, point, q, tension, scale * expected + offset, scale, kept)
        if not definite:
            break
        columns = np.empty((r, m + 4))
        columns[:, 0] = weight - elastic_force(point, stress)
        columns[:, 1 : m + 1] = point.tendons.force_jacobian.T
        columns[:, m + 1 :] = body.tip.T
        solve(factor, columns)
        solved = np.ascontiguousarray(columns.T)
        y, answer, of_tip = solved[0], solved[1 : m + 1], solved[m + 1 :]
        compliance = point.tendons.jacobian @ answer.T
        own = stretch(cables, point.tendons)
        for i in range(m):
            compliance[i, i] += own[i]
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
        expected = point.strain + share * (step @ point.jacobian)
        point = point_at(body, q, pulling)
        if of_law:
            expected = point.strain
        out = weight - elastic_force(point, scale * point.strain + offset) + tension @ point.tendons.force_jacobian
        pull = np.zeros(m) if len(given) else lacking(cables, point.tendons, tension, compliance, wound)
        left = of_tip @ out + body.tip @ (answer.T @ pull)
        if before <= calm and size < near and (left**2).sum() < tolerance**2:
            converged, residual = True, np.sqrt(out @ (body.force_norm @ out))
            break
        before = share * size
    if not converged:
        point, expected = start, expected_first
        forget(kept)  # it may be that of a shape without meaning
    displacement = point.tendons.displacement + stretch(cables, point.tendons) * tension
    return converged, point, expected, q, tension, displacement, compliance, answer, residual
