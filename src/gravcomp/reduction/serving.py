"""Steps of the reduced model, as long as its error is small.

The reduced model is used while it converges, stays within the trained range, and its error is small. The error is measured every
few seconds and after every large motion, with the full model: one Newton step with its own factorised stiffness from the reduced
shape, u* = u - A^-1 R(u), is second-order close to the true equilibrium, so |tip(u*) - tip(u)| is the error. The same measurement
says whether the shape leaves the range of a material's law. Otherwise the full model computes the steps, and from time to time
both are compared, until they agree again.
"""

import dataclasses
import time

import numpy as np

from gravcomp.contact.contacts import Contacts
from gravcomp.full_model.cable_input import CableInput
from gravcomp.full_model.creep import Creep
from gravcomp.full_model.equilibrium import Equilibrium
from gravcomp.full_model.law_range import beyond_range
from gravcomp.full_model.payload import with_payload
from gravcomp.full_model.robot_model import RobotModel
from gravcomp.full_model.shape import Response, Shape, ShapeStatus
from gravcomp.full_model.statics import StaticSolver
from gravcomp.full_model.wrench import PointLoads
from gravcomp.mechanics.total_lagrangian import SolidElements
from gravcomp.reduction.contact import ReducedContact
from gravcomp.reduction.memory import Memory
from gravcomp.reduction.near_itself import NearItself
from gravcomp.reduction.reduced_loads import ReducedLoads
from gravcomp.reduction.reduced_model import ReducedModel, fields
from gravcomp.reduction.tracking import ReducedState, ReducedTracker

# Largest tip error of the reduced model as a fraction of the length; below half of it, the reduced model is used again.
_TOLERANCE = 1e-3
# Steps between two measurements of the error; smallest number of steps after which a motion asks for one.
_CHECK_EVERY, _CHECK_AT_LEAST = 300, 20
# Such a motion: of the shape over the reach, of gravity (over its size: 15 deg), and of a cable over the length. The reach of a
# soft robot, which falls over when its cables are released, is so long that shapes that are held are all near by.
_MOVED, _TURNED, _WOUND = 0.1, 0.26, 0.03
# Steps of the full model before the reduced model is tried again.
_RETURN_AFTER = 25
# Iterations in which the reduced model may find the forces of contact at a shape of the full one.
_TO_AGREE = 30
_DIFFERENT_CREEP = "the materials creep differently, which the reduced model does not have"
_NEAR_ITSELF = "the robot touches itself, or nearly, which the reduced model does not have"
_UNTRAINED = "the shape is outside the range that the reduced model was trained for"


class ReducedServing:
    """Computes steps with the reduced model in place of the full one, and reports when it cannot.

    Attributes: reduced: the reduced model; reason: why it is not used now, empty while it is. The solver `full` of the full
    model measures the error; when the reduced model is left, the solver is at its last shape.
    """

    def __init__(self, model: RobotModel, reduced: ReducedModel, full: StaticSolver, creep: Creep | None = None):
        """creep: the full model's memory, default: it has none."""
        self._model, self.reduced, self._full = model, reduced, full
        self._creep = creep if creep is not None and creep.exists else None
        branches = {material.branches for material in model.mesh.materials}
        self._uniform = len(branches) == 1
        at_rest = np.zeros(reduced.size), np.zeros(reduced.elasticity.linear.shape[1])
        self._memory = Memory.of(branches.pop() if self._uniform else (), *at_rest)
        self._tolerance = _TOLERANCE * model.length
        # Of the step whose error is to be measured: the arguments, and the memory from which it was taken.
        self._due: tuple[np.ndarray, CableInput, float | None, PointLoads | None, Memory] | None = None
        self._tracker = ReducedTracker(reduced, model.length)
        self._loads = ReducedLoads(model, reduced.basis)
        self._itself: NearItself | None = None
        if full.contact is not None:
            change = full.contact.changes(fields(model, reduced.basis))
            if len(full.contact.arrays.kind):
                self._tracker.contact = ReducedContact(full.contact, change)
            if full.contact.own is not None:
                self._itself = NearItself(full.contact, change)
        self.reset()

    def reset(self) -> None:
        """Return to the straight robot; the reduced model is used."""
        self._tracker.place(np.zeros(self.reduced.size), np.zeros(self._model.tendons.count))
        self._error, self._beyond_range = self.reduced.error, ""
        self._mark(self._tracker.state, np.zeros(3))
        self._memory = self._memory.relaxed(self._tracker.state.q, self._tracker.strain)
        self._until_return, self._due = 0, None
        self.reason = ""

    def warm_up(self) -> None:
        """Compile the functions of a step, or load them from the cache; afterwards the robot is straight."""
        contact = self._tracker.contact
        for wound in (None, np.zeros(self._model.tendons.count)):
            for far in (False,) if contact is None else (False, True):
                if contact is not None:
                    contact.clear.far = far  # steps with and without contact are different functions
                state = self._tracker.track(np.zeros(3), CableInput(wound=wound))
                self.reduced.observe(state.q, state.answer)
        self.reset()

    def stand_by(self) -> None:
        """Wait for a shape of the full model, which is used until both models agree."""
        self.reason, self._until_return, self._due = "the reduced model has just been built", 0, None
        # What the full model's branches hold is not known here. It fades, and both models have to agree before this one is used.
        self._memory = self._memory.relaxed(*self._projected(self._full.state))

    @property
    def trusted(self) -> bool:
        """Whether the reduced model is used for the next step."""
        return not self.reason

    @property
    def displacements(self) -> np.ndarray:
        """Displacements (n, 3) of the nodes at the reduced model's shape, in m."""
        u = np.zeros_like(self._model.mesh.nodes)
        self._model.free(u)[:] = self.reduced.basis @ self._tracker.state.q
        return u

    def tip_compliance(self) -> np.ndarray:
        """As `ReducedTracker.tip_compliance`."""
        return self._tracker.tip_compliance()

    def step(
        self,
        gravity: np.ndarray,
        cables: CableInput,
        h: float | None = None,
        loads: PointLoads | None = None,
        later: bool = False,
    ) -> Shape | None:
        """Return the shape under gravity (3,) and the cables' input, tracked from the last one; None: use the full model.

        h: s in which the body has crept since the last shape; None: it has relaxed. loads: act in addition. later: the error of
        this shape is measured by `measure`, if it is due.
        """
        self.measure()
        if not self.trusted:
            return None
        started = time.perf_counter()
        if h is not None and not self._uniform:
            self._leave(_DIFFERENT_CREEP, wait=_RETURN_AFTER)
            return None
        before, sliding = self._tracker.state, self._tracker.sliding
        state = self._tracked(gravity, cables, h, loads)
        if not state.converged:
            self._leave("the reduced model did not converge", wait=0)
            return None
        if self.reduced.outside(state.q) > 1.0:
            self._leave(_UNTRAINED, wait=_RETURN_AFTER)
            return None
        if self._itself is not None and self._itself.at(state.q):
            self._tracker.place(before.q, before.tension, sliding)  # the step may have passed through
            self._leave(_NEAR_ITSELF, wait=_RETURN_AFTER)
            return None
        self._since_check += 1
        moved = self._since_check >= _CHECK_AT_LEAST and self._has_moved(state, gravity)
        if moved or self._since_check >= _CHECK_EVERY:
            self._mark(state, gravity)
            self._due = gravity, cables, h, loads, self._memory
            if not later:
                self.measure()
            if not self.trusted:
                return None
        self._remember(state.q, self._tracker.strain, h)
        return self._shape(state, gravity, started)

    def measure(self) -> None:
        """Measure the error of the last shape if that is due; where it is too large, the full model is used from there."""
        if self._due is None:
            return
        gravity, cables, h, loads, memory = self._due
        self._error = self._measured_error(gravity, cables, h, loads, memory)
        self._due = None
        if not self._error < self._tolerance:
            self._leave(f"the tip error of the reduced model is {1e3 * self._error:.2f} mm", wait=_RETURN_AFTER)

    def take_over(
        self,
        state: Equilibrium,
        gravity: np.ndarray,
        cables: CableInput,
        h: float | None = None,
        loads: PointLoads | None = None,
    ) -> None:
        """After a step of the full model, of h s: use the reduced model again if both agree. Compared every few steps only."""
        self._until_return -= 1
        if self._until_return <= 0:
            self.follow(state, gravity, cables, h, loads)
        elif self._creep is not None and state.converged:
            self._remember(*self._projected(state), h)

    def follow(
        self,
        state: Equilibrium,
        gravity: np.ndarray,
        cables: CableInput,
        h: float | None = None,
        loads: PointLoads | None = None,
    ) -> None:
        """Go to a shape of the full model, in h s; use the reduced model from there if both agree on it."""
        self.reason = self.reason or _UNTRAINED
        self._until_return, self._due = _RETURN_AFTER, None
        if not state.converged:
            return
        q, strain = self._projected(state)
        self._tracker.place(q, state.tension, self._full.sliding)
        if self._tracker.contact is not None and state.touch is not None:
            self._tracker.contact.take_over(state.touch, self.reduced.basis)
        if self._itself is not None and self._itself.at(q):
            self.reason = _NEAR_ITSELF
            self._remember(q, strain, h)
            return
        own = self._tracked(gravity, cables, h, loads, iterations=_TO_AGREE)
        self._remember(q, strain, h)
        if h is not None and not self._uniform:
            self.reason = _DIFFERENT_CREEP
            return
        error = float(np.linalg.norm(self.reduced.tip(own.q) - self._tip(state.u)))
        if own.converged and self.reduced.outside(own.q) <= 1.0 and error < 0.5 * self._tolerance:
            self.reason, self._error = "", error
            self._mark(own, gravity)

    def _tracked(
        self, gravity: np.ndarray, cables: CableInput, h: float | None, loads: PointLoads | None, iterations: int = 20
    ) -> ReducedState:
        """Track the reduced model; the forces of loads that turn with their sections are those of the last shape."""
        creep = None if h is None else self._memory.stress(h)
        loads = with_payload(self._model, gravity, loads)
        force = None if loads is None else self._loads.at(loads, self._tracker.state.q)
        return self._tracker.track(gravity, cables, iterations=iterations, creep=creep, force=force)

    def _projected(self, state: Equilibrium) -> tuple[np.ndarray, np.ndarray]:
        """Return the coordinates (r,) of a shape of the full model and their strain (m,)."""
        return self.reduced.projected(self._model.free(state.u))

    def _remember(self, q: np.ndarray, strain: np.ndarray, h: float | None) -> None:
        """Let the body creep to q (r,), where the strain is (m,), in h s; None: it is relaxed there."""
        if self._creep is not None:
            self._memory = self._memory.relaxed(q, strain) if h is None else self._memory.after(q, strain, h)

    def _leave(self, reason: str, wait: int) -> None:
        """Stop using the reduced model, for at least `wait` steps."""
        self.reason, self._until_return = reason, wait
        self._hand_over(self._memory)

    def _hand_over(self, memory: Memory) -> None:
        """Set the full model to the reduced model's shape and to a memory."""
        u, sliding, contact = self.displacements, self._tracker.sliding, self._tracker.contact
        if self._creep is not None and self._uniform:
            assert isinstance(self._model.elements, SolidElements)
            self._creep.strain, self._creep.held = memory.at_points(self._model.elements, self.reduced.basis)
        elif self._creep is not None:
            self._creep.relax(u)
        self._full.sliding = sliding
        self._full.state = dataclasses.replace(
            self._full.state,
            u=u,
            tension=self._tracker.state.tension.copy(),
            tendons=self._model.tendons.state(self._model.mesh.nodes + u, sliding.direction),
            touch=None if contact is None else contact.hand_over(u),
        )

    def _mark(self, state: ReducedState, gravity: np.ndarray) -> None:
        """Remember where the error is measured: at this state under gravity (3,)."""
        self._since_check, self._checked_at = 0, (state.q, gravity.copy(), state.displacement)

    def _has_moved(self, state: ReducedState, gravity: np.ndarray) -> bool:
        """Return whether the robot is far from where the error was measured."""
        q, direction, displacement = self._checked_at
        moved, turned = state.q - q, gravity - direction
        return bool(
            moved @ moved > (_MOVED * self.reduced.reach) ** 2
            or turned @ turned > _TURNED**2 * (gravity @ gravity)
            or any(abs(wound) > _WOUND * self._model.length for wound in (state.displacement - displacement).tolist())
        )

    def _measured_error(
        self, gravity: np.ndarray, cables: CableInput, h: float | None, loads: PointLoads | None, memory: Memory
    ) -> float:
        """Return the tip error of the reduced model in m, after a step of h s from a memory."""
        self._hand_over(memory)
        self._full.viscous = None if h is None or self._creep is None else self._creep.step(h)
        before = self._tip(self._full.state.u)
        self._beyond_range = beyond_range(self._model, self._full.state.u)
        return float(np.linalg.norm(self._tip(self._full.track(gravity, cables, iterations=1, loads=loads).u) - before))

    def _tip(self, u: np.ndarray) -> np.ndarray:
        return self._model.effectors.sections(self._model.mesh.nodes + u)[-1, 0]

    def _shape(self, state: ReducedState, gravity: np.ndarray, started: float) -> Shape:
        sections, effector, compliance_ea, orientation = self.reduced.observe(state.q, state.answer)
        return Shape(
            tip_position=sections[-1, 0],
            tip_orientation=orientation[-1],
            backbone_station=self._model.effectors.station,
            backbone_position=sections[:-1, 0],
            backbone_orientation=orientation[:-1],
            cable_displacement=state.displacement,
            cable_tension=state.tension,
            gravity=gravity,
            response=Response(
                compliance_aa=state.compliance,
                compliance_ea=compliance_ea,
                displacement_free=state.displacement - state.compliance @ state.tension,
                effector_free=effector - compliance_ea @ state.tension,
            ),
            residual=state.residual,
            error_estimate=self._error,
            solve_time=time.perf_counter() - started,
            model="reduced",
            status=ShapeStatus.OK,
            message=self._beyond_range,
            contacts=Contacts.none() if self._tracker.contact is None else self._tracker.contact.contacts(),
        )
