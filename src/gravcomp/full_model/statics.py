"""Static equilibrium with cables.

Sought are displacements u and tensions lambda with

    f_int(u) = f_weight + H(u)^T lambda,
    driven by tension:       lambda given;
    driven by displacement:  lambda >= 0, delta(u) + c lambda - wound >= 0, complementary (c: the cable's own elongation).

Newton's step solves A y = r and A X = H^T with A = K(u, lambda), so that the step is y + X dlambda and the cables answer by
W = H X; the tensions come from the small complementarity problem (Coevoet et al. 2017, section IV). From the second step
on, A contains the stress that the step before foresaw (see `SolidElements.assemble`): a beam then bends as far as it must in
a handful of steps. While a robot is followed, the factor of a step before serves as long as the corrections that it gives shrink
fast. A step is cut where it is longer than a fraction of the robot or would crush an element; where Newton
gives up all the same, the load is applied in parts. Not every load has an equilibrium: St. Venant-Kirchhoff's material
resists less and less from a stretch of 1 / sqrt(3) down (E = -1/3), so that a robot of it folds under a large tension.
"""

import dataclasses
import math

import numpy as np

from gravcomp.cables.slack import taut_tensions
from gravcomp.cables.tendons import TendonState
from gravcomp.full_model.model import RobotModel
from gravcomp.mechanics.block_matrix import BlockCholesky, NotPositiveDefinite

# An element that has lost this much of its volume has been thrown there by a wild step.
_CRUSHED = 0.1
# Steps below this part of the tolerance are what arithmetic leaves, and do not shrink any more.
_ROUNDING = 1e-3
# A step below this part of it is the last, whatever the next ones would be: they may sum up to ten times as much.
_SHORT = 0.1
# A factor serves again up to this displacement from where it was made, as a fraction of the length, and while each correction is at
# most this part of the one before.
_FACTOR_REACH, _FACTOR_CONTRACTION = 0.01, 0.1


@dataclasses.dataclass(frozen=True)
class CableInput:
    """What is done to the cables: `wound` (m,) in m, NaN where released; or `tension` (m,) in N, which goes first."""

    wound: np.ndarray | None = None
    tension: np.ndarray | None = None

    def tensions(self, compliance: np.ndarray, free: np.ndarray, taut: np.ndarray) -> np.ndarray:
        """(m,) tensions for the linear answer displacement = compliance tension + free."""
        if self.tension is not None:
            return self.tension
        if self.wound is None:
            return np.zeros(len(free))
        return taut_tensions(compliance, free, self.wound, taut)

    def part(self, origin: np.ndarray, fraction: float) -> "CableInput":
        """The input on the way from the displacements `origin` (m,), or from no tension, to this one."""
        if self.tension is not None:
            return CableInput(tension=fraction * self.tension)
        if self.wound is None:
            return self
        return CableInput(wound=origin + fraction * (self.wound - origin))


@dataclasses.dataclass
class Equilibrium:
    """A state of the robot: displacements u (n, 3), tensions (m,), and the last linearisation's compliance (m, m) and
    response of the unknowns to the tensions, X (3 n_free, m). `carried`: the share of the load this is the equilibrium of,
    less than one where the whole could not be balanced.
    """

    u: np.ndarray
    tension: np.ndarray
    compliance: np.ndarray
    answer: np.ndarray
    tendons: TendonState
    residual: float = np.inf
    converged: bool = False
    iterations: int = 0
    carried: float = 1.0


class StaticSolver:
    """Finds equilibria of a model and follows them; it owns the stiffness matrix and the current state."""

    def __init__(self, model: RobotModel, tolerance: float = 1e-6, longest_step: float = 0.25, near: float = 0.03):
        """tolerance, longest_step and near (the step below which a factor is used again): displacement of a node as a
        fraction of the robot's length.
        """
        self.model = model
        self.tolerance = tolerance * model.length
        self.longest_step = longest_step * model.length
        self.near = near * model.length
        self._matrix = model.new_matrix()
        model.elements.assemble(np.zeros_like(model.mesh.nodes), self._matrix)
        self._stiffness = self._matrix.mean_diagonal()
        self._pulling = np.zeros(model.tendons.count)
        self.reset()

    def reset(self) -> None:
        """Back to the straight robot without tension."""
        self._kept: tuple[BlockCholesky, np.ndarray] | None = None  # a factor, and the displacements (n, 3) that it is of
        count = self.model.tendons.count
        u = np.zeros_like(self.model.mesh.nodes)
        tendons = self.model.tendons.state(self.model.mesh.nodes)
        self._pulling[:] = 0.0
        self.state = Equilibrium(u, np.zeros(count), np.zeros((count, count)), np.zeros((3 * self.model.n_free, count)), tendons)

    def track(
        self, gravity: np.ndarray, cables: CableInput, iterations: int = 4, exact: bool = False, stable: bool = False
    ) -> Equilibrium:
        """Follow the equilibrium from the current state; `converged` tells whether it was reached.

        `exact` asks for a thousandth of the tolerance and for factors of this shape's own, for shapes and answers to compare with. `stable`
        gives up where the tangent is not positive definite.
        """
        previous = self.state
        if exact:
            self._kept = None
        state = dataclasses.replace(previous, u=previous.u.copy(), converged=False, iterations=0, carried=1.0)
        self._update_pulling(state, cables)
        weight = self.model.weight(gravity)
        origin, finer = None, 1e-3 if exact else 1.0
        while not state.converged and state.iterations < iterations:
            origin = self._newton(state, weight, cables, origin, finer * self.tolerance, stable)
            if origin is None:
                self._measure(state, weight)
                break
            self._measure(state, weight)
            state.converged &= state.residual <= self._balance(state, weight)
        self.state = state
        return state

    def solve(self, gravity: np.ndarray, cables: CableInput, parts: int = 64) -> Equilibrium:
        """The equilibrium from any state: tracking first, then from the straight robot with the load in parts.

        Where the smallest part more (1 / parts of the load) finds none, the last equilibrium on the way is returned with
        `carried` below one and the solver stays where it was: the branch ends there in a limit point, or nearly.
        """
        start = self.state
        if self.track(gravity, cables, iterations=15, exact=True).converged:
            return self.state
        self.reset()
        here, origin = self.state, self.state.tendons.displacement
        done, part = 0.0, 0.25
        while done < 1.0:
            fraction = min(1.0, done + part)
            if self.track(fraction * np.asarray(gravity), cables.part(origin, fraction), 15, exact=True).converged:
                here, done, part = self.state, fraction, 2.0 * part
                continue
            self.state = here
            part /= 2.0
            if part < 1.0 / parts:
                self.state = start
                return dataclasses.replace(here, converged=False, carried=done)
        return self.state

    def _update_pulling(self, state: Equilibrium, cables: CableInput) -> None:
        """Which way the cables slide, for their friction."""
        if not self.model.tendons.friction.any():
            return
        if cables.tension is not None:
            change = cables.tension - state.tension
        elif cables.wound is not None:
            change = np.nan_to_num(cables.wound - state.tendons.displacement)
        else:
            change = -state.tension
        self._pulling = np.where(np.abs(change) > 1e-9, np.sign(change), self._pulling)

    def _newton(
        self,
        state: Equilibrium,
        weight: np.ndarray,
        cables: CableInput,
        origin: np.ndarray | None,
        tolerance: float,
        stable: bool,
    ) -> np.ndarray | None:
        """One damped Newton step of `state` with the corrections its factor allows.

        origin (n, 3): where the last move before began. Returns where the last move began; None when no step helps.
        """
        model = self.model
        state.iterations += 1
        factor = self._kept_factor(state)
        if factor is not None:
            again, force, exact = True, model.elements.internal_force(state.u), True
        else:
            try:
                factor, force, exact = self._factor(state, origin, stable)
            except NotPositiveDefinite:
                return None
            again = False
            if exact and origin is None:
                self._kept = factor, state.u.copy()
        jacobian = state.tendons.jacobian
        pull = state.tendons.force_jacobian
        out = weight - model.free(force)
        solved = factor.solve(np.column_stack([out, pull.T]))
        y, state.answer = solved[:, 0], solved[:, 1:]
        state.compliance = jacobian @ state.answer + np.diag(model.tendons.axial_compliance)
        free = state.tendons.displacement + jacobian @ y
        if not math.isfinite(state.compliance.sum() + free.sum()):
            return None
        tension = cables.tensions(state.compliance, free, state.tension > 0.0)
        step, change = y + state.answer @ tension, tension - state.tension
        size = np.abs(step).max()
        if not np.isfinite(size):
            return None
        damping = min(1.0, self.longest_step / size) if size > 0 else 1.0
        start, before = state.u.copy(), state.tension
        while True:
            model.free(state.u)[:] = model.free(start) + damping * step
            if model.elements.smallest_volume_ratio(state.u) > _CRUSHED:
                break
            damping /= 2.0
            if damping < 1e-4:
                state.u[:] = start
                return None
        state.tension = before + damping * change
        state.tendons = model.tendons.state(model.mesh.nodes + state.u, self._pulling)
        # Near the equilibrium the factor is good for corrections, which cost a tenth of a new one. What they still leave is
        # the rest of a geometric series; its ratio shows between two corrections, not between the step and the first of
        # them, which is short even where the stiffness has turned so far from the factor's that none shortens any more.
        corrected = False
        while exact and damping == 1.0 and size < self.near:
            correction, tension = self._correction(state, factor, weight, cables, jacobian)
            length = np.abs(correction).max()
            if max(length, size) < _ROUNDING * tolerance:  # it was at rest there already
                state.converged = True
                break
            if again and length > _FACTOR_CONTRACTION * size:
                self._kept = None
            if not length < 0.3 * size:
                break
            start = state.u.copy()
            model.free(state.u)[:] += correction
            state.tension = tension
            state.tendons = model.tendons.state(model.mesh.nodes + state.u, self._pulling)
            ratio = length / size if corrected else 0.5
            if length * ratio / (1.0 - ratio) < tolerance:
                state.converged = True
                break
            size, corrected = length, True
        # A tangent that is not quite that of the forces (corotational elements) gives steps that shrink slowly; these are short enough.
        state.converged |= exact and damping == 1.0 and size < _SHORT * tolerance
        return start

    def _kept_factor(self, state: Equilibrium) -> BlockCholesky | None:
        """The factor of a step before, where it may serve in the first iteration of another."""
        if self._kept is None or state.iterations > 1:
            return None
        factor, u = self._kept
        return factor if np.abs(state.u - u).max() < _FACTOR_REACH * self.model.length else None

    def _correction(
        self, state: Equilibrium, factor: BlockCholesky, weight: np.ndarray, cables: CableInput, jacobian: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """What the factor of a point nearby would still change here: unknowns and tensions."""
        model = self.model
        force = model.elements.internal_force(state.u)
        out = weight - model.free(force) + state.tension @ state.tendons.force_jacobian
        y = factor.solve(out)
        free = state.tendons.displacement + jacobian @ y
        shift = (state.compliance - np.diag(model.tendons.axial_compliance)) @ state.tension
        tension = cables.tensions(state.compliance, free - shift, state.tension > 0.0)
        return y + state.answer @ (tension - state.tension), tension

    def _factor(self, state: Equilibrium, origin: np.ndarray | None, stable: bool) -> tuple[BlockCholesky, np.ndarray, bool]:
        """The factorised tangent, the internal forces, and whether the tangent is exact.

        Where it is not positive definite, a multiple of the identity is added unless `stable`: the step goes downhill still, but its
        length no longer tells how far the equilibrium is.
        """
        self._kept = None  # its place is taken
        shifts = () if stable else (self._stiffness * 10.0**power for power in range(-6, 1))
        for shift in (0.0, *shifts):
            self._matrix.values[:] = 0.0
            force = self.model.elements.assemble(state.u, self._matrix, origin=origin)
            if state.tension.any():
                self.model.tendons.add_stiffness(state.tendons, state.tension, self._matrix)
            if shift:
                self._matrix.add_diagonal(shift)
            try:
                return self._matrix.factor(), force, shift == 0.0
            except NotPositiveDefinite:
                continue
        raise NotPositiveDefinite("the tangent stiffness has no Cholesky factor, however it is shifted")

    def _balance(self, state: Equilibrium, weight: np.ndarray) -> float:
        """The force out of balance that counts as none: short corrections of a factor that is too stiff prove nothing."""
        pull = state.tension @ state.tendons.force_jacobian
        return 1e-2 * max(np.abs(weight).max(), np.abs(pull).max(initial=0.0)) + 1e-12 * self._stiffness * self.model.length

    def _measure(self, state: Equilibrium, weight: np.ndarray) -> None:
        """The largest force out of balance."""
        force = self.model.free(self.model.elements.internal_force(state.u))
        out = weight - force + state.tension @ state.tendons.force_jacobian
        state.residual = float(np.abs(out).max())
