"""Newton's method for the static equilibrium with cables, started from the last state.

Unknown are the displacements u and the tensions lambda with

    f_int(u) = f_weight + H(u)^T lambda,
    driven by tension:       lambda given;
    driven by displacement:  lambda >= 0, delta(u) + c lambda - wound >= 0, complementary (c: stretch of the cable).

Newton's step solves A y = r and A X = H^T with A = K(u, lambda), so that the step is y + X dlambda and the compliance of the
cables is W = H X; the tensions follow from the small complementarity problem (Coevoet et al. 2017, section IV). From the second
step on, A contains the stress that the previous step predicted (see `SolidElements.assemble`): a beam then bends as far as
needed in a few steps. While a robot is tracked, the factor of an earlier step is used again as long as its corrections shrink
fast. A step is cut if it is longer than a fraction of the robot or would crush an element.
"""

import dataclasses
import math

import numpy as np

from gravcomp.cables.friction import Sliding
from gravcomp.full_model.alternation import Alternation
from gravcomp.full_model.applied_load import AppliedLoad
from gravcomp.full_model.cable_input import CableInput
from gravcomp.full_model.contact import FullContact
from gravcomp.full_model.equilibrium import Equilibrium
from gravcomp.full_model.model import MeshedModel
from gravcomp.full_model.payload import with_payload
from gravcomp.full_model.shifted_factor import ShiftedFactor
from gravcomp.full_model.supports import SupportedFactor, add_springs
from gravcomp.full_model.wrench import PointLoads
from gravcomp.mechanics.block_matrix import BlockCholesky, Factor, NotPositiveDefinite
from gravcomp.mechanics.viscous_strain import ViscousStrain

# Smallest det F that a step may leave in an element.
_CRUSHED = 0.1
# A step below this fraction of the tolerance is rounding error and shrinks no further.
_ROUNDING = 1e-3
# A step below this fraction of the tolerance is the last one: the steps that would follow may add up to ten times its length.
_SHORT = 0.1
# Places of contact are found in some more steps.
_MORE_IN_CONTACT = 3
# A factor is used again up to this displacement from where it was made, as a fraction of the length, and as long as each
# correction is at most this fraction of the previous one.
_FACTOR_REACH, _FACTOR_CONTRACTION = 0.01, 0.1
# The largest change of shape that is extrapolated, as a fraction of the length: longer ones are transients.
_LONGEST_AHEAD = 0.01


class StaticTracker:
    """Tracks the equilibrium of a model. Owns the stiffness matrix, the current `state`, and the `sliding` of the cables.

    viscous: strain of what the materials' branches hold in the equilibrium (`full_model.creep`); None: they have relaxed.
    contact: with the obstacles of a scene; None: nothing is in the way.
    """

    contact: FullContact | None = None
    extrapolates = False
    """Whether a track starts where the last change of shape leads if it happens again: good where the load changes evenly."""

    def __init__(self, model: MeshedModel, tolerance: float = 1e-6, longest_step: float = 0.25, near: float = 0.03):
        """Start from the straight robot.

        tolerance, longest_step and near (the step below which a factor is used again) are displacements of a node as fractions
        of the robot's length.
        """
        self.model = model
        self.tolerance = tolerance * model.length
        self.longest_step = longest_step * model.length
        self.near = near * model.length
        self.viscous: ViscousStrain | None = None
        self._alternation = Alternation()
        self._matrix = model.new_matrix()
        model.elements.assemble(np.zeros_like(model.mesh.nodes), self._matrix)
        self._stiffness = self._matrix.mean_diagonal()
        self._shifted = ShiftedFactor(self._matrix, self._stiffness)
        self.reset()

    def reset(self) -> None:
        """Return to the straight robot without tension."""
        self._contained: list[np.ndarray] = []  # of the loads that turn, in the last factor
        self._springs: tuple[tuple[float, ...], ...] = ()  # that the kept factor holds, see `AppliedLoad.springs`
        self._kept: tuple[BlockCholesky, np.ndarray] | None = None  # a factor, and the displacements (n, 3) where it was made
        self._failed = False  # whether the last new tangent was not positive definite
        self._before: np.ndarray | None = None  # displacements (n, 3) of the equilibrium before the current one
        count = self.model.tendons.count
        u = np.zeros_like(self.model.mesh.nodes)
        tendons = self.model.tendons.state(self.model.mesh.nodes)
        self.sliding = Sliding.none(count, self.model.length)
        self.state = Equilibrium(u, np.zeros(count), np.zeros((count, count)), np.zeros((3 * self.model.n_free, count)), tendons)

    def track(
        self,
        gravity: np.ndarray,
        cables: CableInput,
        iterations: int = 4,
        exact: bool = False,
        stable: bool = False,
        loads: PointLoads | None = None,
        fraction: float = 1.0,
    ) -> Equilibrium:
        """Track the equilibrium from the current state; the result's `converged` says whether it was reached.

        exact: use a thousandth of the tolerance and new factors of the present shape, for reference results. stable: stop where
        the tangent is not positive definite. loads: act in addition, by `fraction` of their value.
        """
        contact, before = self.contact, (self.state, self.sliding, self._before)
        way = 0.0 if contact is None else contact.free_way(self.state.u)
        if contact is not None and self._before is not None and contact.way(self._before, self.state.u) > way:
            way = 0.0  # steps are long
        if contact is not None and way > 0.0:
            self.contact = None  # nothing is near
            try:
                state = self._tracked(gravity, cables, iterations, exact, stable, loads, fraction)
            finally:
                self.contact = contact
            if state.converged and contact.way(before[0].u, state.u) < way:
                return state
            (self.state, self.sliding, self._before), self._kept = before, None
        return self._tracked(gravity, cables, iterations, exact, stable, loads, fraction)

    def _tracked(
        self,
        gravity: np.ndarray,
        cables: CableInput,
        iterations: int,
        exact: bool,
        stable: bool,
        loads: PointLoads | None,
        fraction: float,
    ) -> Equilibrium:
        """Do as `track`, with contact if there is any."""
        previous = self.state
        if exact:
            self._kept = None
        touch = None if self.contact is None else previous.touch
        state = dataclasses.replace(previous, touch=touch, u=previous.u.copy(), converged=False, iterations=0, load_fraction=1.0)
        if self.model.tendons.friction.any():
            stretched = self.model.tendons.stretch(state.tendons) * state.tension
            self.sliding = cables.sliding(self.sliding, state.tension, state.tendons.displacement + stretched)
        if self.extrapolates and self._before is not None:
            self._go_ahead(state, self._before)
        if self.contact is not None:
            self.contact.begin(previous, gravity)
            self._alternation.begin()
            iterations *= _MORE_IN_CONTACT
        loads = with_payload(self.model, gravity / fraction, loads)
        load = AppliedLoad(self.model.weight(gravity), loads, fraction)
        if load.turns or load.springs != self._springs:
            self._kept = None  # it may be of other loads
        self._springs = load.springs
        origin: np.ndarray | None = None
        finer = 1e-3 if exact else 1.0
        while not state.converged and state.iterations < iterations:
            origin = self._newton_step(state, load, cables, origin, finer * self.tolerance, stable)
            self._measure(state, load)
            if origin is None:
                break
            settled = self.contact is None or self.contact.touch.settled
            state.converged &= settled and state.residual <= self._allowed_residual(state, load)
        if self.contact is not None:
            state.touch = self.contact.touch
        self._before = previous.u if state.converged and previous.converged else None
        self.state = state
        return state

    def _go_ahead(self, state: Equilibrium, before: np.ndarray) -> None:
        """Move `state` as far again as from the displacements `before` (n, 3) to it, if that is not far."""
        change = state.u - before
        if np.abs(change).max() < _LONGEST_AHEAD * self.model.length:
            state.u += change
            state.tendons = self.model.tendons.state(self.model.mesh.nodes + state.u, self.sliding.direction)

    def tip_compliance(self) -> np.ndarray:
        """Return the displacement of the tip (3, 3) m/N by forces on it at given tensions, at the present state.

        Raises NotPositiveDefinite where the state is not stable.
        """
        return self.compliance(np.kron(self.model.section_rows(1.0)[0, : self.model.n_free, None], np.eye(3)))

    def compliance(self, pulls: np.ndarray, loads: PointLoads | None = None) -> np.ndarray:
        """Return pulls^T A^-1 pulls for forces on the unknowns, the columns of `pulls` (3 n_free, k), at the present state.

        loads: those that turn or come from springs change A. Raises NotPositiveDefinite where the state is not stable.
        """
        model, state, load = self.model, self.state, AppliedLoad(np.zeros(0), loads, 1.0)
        self._kept = None
        self._matrix.values[:] = 0.0
        model.elements.assemble(state.u, self._matrix, self.viscous)
        if state.tension.any():
            model.tendons.add_stiffness(state.tendons, state.tension, self._matrix)
        contained = load.add_to_tangent(self._matrix, state.u)
        compliance: np.ndarray = pulls.T @ load.turned(self._matrix.factor(), state.u, contained).solve(pulls)
        return compliance

    def _newton_step(
        self,
        state: Equilibrium,
        load: AppliedLoad,
        cables: CableInput,
        origin: np.ndarray | None,
        tolerance: float,
        stable: bool,
    ) -> np.ndarray | None:
        """Take one damped Newton step and the corrections that its factor allows; changes `state`.

        origin (n, 3): displacements from which the last move began. Returns those of this step's last move; None when no step
        helps.
        """
        model = self.model
        state.iterations += 1
        factor: BlockCholesky | SupportedFactor | None = self._reusable_factor(state)
        exact, reused = True, factor is not None
        if factor is not None:
            force = model.elements.internal_force(state.u, self.viscous)
        else:
            try:
                factor, force, exact = self._new_factor(state, load, origin, stable)
            except NotPositiveDefinite:
                return None
            if exact and origin is None and isinstance(factor, BlockCholesky):
                self._kept = factor, state.u.copy()
        jacobian = state.tendons.jacobian
        out = load.at(state.u) - model.free(force)
        solver = load.turned(factor, state.u, self._contained)
        supported = factor if isinstance(factor, SupportedFactor) else None
        if self.contact is not None:
            step, tension = self.contact.respond(state, solver, out, cables, supported)
        else:
            solved = solver.solve(np.column_stack([out, state.tendons.force_jacobian.T]))
            y, state.answer = solved[:, 0], solved[:, 1:]
            state.compliance = jacobian @ state.answer + np.diag(model.tendons.stretch(state.tendons))
            free = state.tendons.displacement + jacobian @ y
            if not math.isfinite(state.compliance.sum() + free.sum()):
                return None
            tension = cables.tensions(state.compliance, free, state.tension > 0.0)
            step = y + state.answer @ tension
        size = float(np.abs(step).max())
        if not math.isfinite(size):
            return None
        part = 1.0 if self.contact is None else self._alternation.part(step)
        moved = self._damped_move(state, part * step, state.tension + part * (tension - state.tension), part * size)
        if moved is None:
            return None
        start, undamped = moved
        if exact and undamped and part == 1.0:
            start, size = self._correct(state, solver, load, cables, jacobian, start, size, tolerance, reused, supported)
            # The tangent of corotational elements is not exact: steps shrink slowly. This one is short enough.
            state.converged |= size < _SHORT * tolerance
        return start

    def _damped_move(
        self, state: Equilibrium, step: np.ndarray, tension: np.ndarray, size: float
    ) -> tuple[np.ndarray, bool] | None:
        """Move `state` along the step (3 n_free,) toward the tensions (m,), cut where it is too long or crushes an element.

        size: length of the step in m. Returns the displacements (n, 3) before, and whether the whole step was taken; None, with
        the displacements unchanged, if even a short part of it crushes an element.
        """
        model = self.model
        longest = self.longest_step if self.contact is None else min(self.longest_step, self.contact.longest)
        damping = min(1.0, longest / size) if size > 0 else 1.0
        if self.contact is not None:
            damping = min(damping, self.contact.part_that_passes(state.u, step))
        start = state.u.copy()
        while True:
            model.free(state.u)[:] = model.free(start) + damping * step
            if model.elements.smallest_volume_ratio(state.u) > _CRUSHED:
                break
            damping /= 2.0
            if damping < 1e-4:
                state.u[:] = start
                return None
        state.tension = state.tension + damping * (tension - state.tension)
        state.tendons = model.tendons.state(model.mesh.nodes + state.u, self.sliding.direction)
        return start, damping == 1.0

    def _correct(
        self,
        state: Equilibrium,
        factor: Factor,
        load: AppliedLoad,
        cables: CableInput,
        jacobian: np.ndarray,
        start: np.ndarray,
        size: float,
        tolerance: float,
        reused: bool,
        supported: SupportedFactor | None,
    ) -> tuple[np.ndarray, float]:
        """Correct `state` with the factor of the step just taken, as long as the corrections shrink.

        Near the equilibrium the factor is good enough for corrections, which cost a tenth of a new factor. The error that
        remains is the rest of a geometric series. Its ratio is measured between two corrections: the first correction is short
        compared with the step even if the factor no longer contracts. Returns the displacements (n, 3) before the last move,
        and the length of that move in m.
        """
        model = self.model
        corrected = False
        while size < self.near:
            correction, tension = self._correction(state, factor, load, cables, jacobian, supported)
            length = float(np.abs(correction).max())
            if max(length, size) < _ROUNDING * tolerance:  # already at rest
                state.converged = True
                break
            if reused and length > _FACTOR_CONTRACTION * size:
                self._kept = None
            if not length < 0.3 * size:
                break
            start = state.u.copy()
            model.free(state.u)[:] += correction
            state.tension = tension
            state.tendons = model.tendons.state(model.mesh.nodes + state.u, self.sliding.direction)
            ratio = length / size if corrected else 0.5
            if length * ratio / (1.0 - ratio) < tolerance:
                state.converged = True
                break
            size, corrected = length, True
        return start, size

    def _correction(
        self,
        state: Equilibrium,
        factor: Factor,
        load: AppliedLoad,
        cables: CableInput,
        jacobian: np.ndarray,
        supported: SupportedFactor | None,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the change (3 n_free,) of the unknowns and the tensions (m,) from the factor of a nearby shape."""
        model = self.model
        force = model.elements.internal_force(state.u, self.viscous)
        if self.contact is not None:
            return self.contact.respond(state, factor, load.at(state.u) - model.free(force), cables, supported)
        out = load.at(state.u) - model.free(force) + state.tension @ state.tendons.force_jacobian
        y = factor.solve(out)
        free = state.tendons.displacement + jacobian @ y
        body = jacobian @ state.answer
        # The stretch of the present shape: with friction the mean tension along a cable changes with its bends.
        state.compliance = body + np.diag(model.tendons.stretch(state.tendons))
        shift = body @ state.tension
        tension = cables.tensions(state.compliance, free - shift, state.tension > 0.0)
        return y + state.answer @ (tension - state.tension), tension

    def _reusable_factor(self, state: Equilibrium) -> BlockCholesky | None:
        """Return the factor of an earlier step if it may be used in the first iteration at `state`."""
        if self._kept is None or state.iterations > 1:
            return None
        factor, u = self._kept
        return factor if np.abs(state.u - u).max() < _FACTOR_REACH * self.model.length else None

    def _new_factor(
        self, state: Equilibrium, load: AppliedLoad, origin: np.ndarray | None, stable: bool
    ) -> tuple[BlockCholesky | SupportedFactor, np.ndarray, bool]:
        """Return the factorised tangent, the internal forces (n, 3), and whether the tangent is exact.

        If the tangent is not positive definite, it is supported where walls press. If it is not even then, a multiple of the
        identity is added (`ShiftedFactor`): the step still goes downhill, but its length no longer measures the distance to the
        equilibrium. Raises NotPositiveDefinite if that does not help, or before that if `stable`.
        """
        self._kept = None  # the storage of that factor is written over
        force = self._assemble(state, load, origin)
        sections = [] if self.contact is None else self.contact.pressed_sections()
        # The factorisation writes over it. Where the last one failed, this one often fails as well.
        tangent = self._matrix.values.copy() if self._failed else None
        try:
            factor = self._matrix.factor()
            self._failed = False
            return factor, force, True
        except NotPositiveDefinite:
            self._failed = True
            if stable and not sections:
                raise
        if tangent is None:
            self._assemble(state, load, origin)
            tangent = self._matrix.values.copy()
        else:
            self._matrix.values[:] = tangent
        supported = self._supported_factor(sections)
        if supported is not None:
            return supported, force, True
        if stable:
            raise NotPositiveDefinite("the tangent stiffness is not positive definite, with supports where walls press")
        self._matrix.values[:] = tangent
        return self._shifted.factor(), force, False

    def _supported_factor(self, sections: list[np.ndarray]) -> SupportedFactor | None:
        """Return the factor of the assembled tangent with supports of `sections`, rows (n,); None where that does not help."""
        rows = add_springs(self._matrix, self.model, sections, self._stiffness)
        if not len(rows):
            return None
        try:
            return SupportedFactor(self._matrix.factor(), rows, self._stiffness)
        except NotPositiveDefinite:
            return None

    def _assemble(self, state: Equilibrium, load: AppliedLoad, origin: np.ndarray | None) -> np.ndarray:
        """Assemble the tangent at `state` and return the internal forces (n, 3)."""
        self._matrix.values[:] = 0.0
        force = self.model.elements.assemble(state.u, self._matrix, self.viscous, origin)
        if state.tension.any():
            self.model.tendons.add_stiffness(state.tendons, state.tension, self._matrix)
        self._contained = load.add_to_tangent(self._matrix, state.u)
        return force

    def _allowed_residual(self, state: Equilibrium, load: AppliedLoad) -> float:
        """Return the force out of balance in N below which a state counts as balanced.

        Short steps alone prove nothing: the corrections of a factor that is too stiff are short as well.
        """
        pull = self._pull(state)
        largest = max(np.abs(load.at(state.u)).max(), np.abs(pull).max(initial=0.0))
        return 1e-2 * largest + 1e-12 * self._stiffness * self.model.length

    def _pull(self, state: Equilibrium) -> np.ndarray:
        """Return the forces (3 n_free,) of cables and contact on the unknowns."""
        pull = state.tension @ state.tendons.force_jacobian
        return pull if self.contact is None else pull + self.contact.touch.pull

    def _measure(self, state: Equilibrium, load: AppliedLoad) -> None:
        """Set the residual of `state`."""
        force = self.model.free(self.model.elements.internal_force(state.u, self.viscous))
        out = load.at(state.u) - force + self._pull(state)
        state.residual = float(np.abs(out).max())
