"""Serving steps from the reduced model while it can be trusted.

It is trusted as long as it converges, stays within what was trained, and its error, measured every few seconds and
after every large motion, is small. The full model measures it: one Newton step with its own factorised stiffness from
the reduced shape, u* = u - A^-1 R(u), comes second-order close to the true equilibrium, so |tip(u*) - tip(u)| is the
error. While the reduced model is not trusted the full one serves, and now and then both are compared, until they agree
again.
"""

import dataclasses
import time

import numpy as np

from gravcomp.full_model.model import RobotModel
from gravcomp.full_model.shape import Response, Shape, ShapeStatus
from gravcomp.full_model.statics import CableInput, Equilibrium, StaticSolver
from gravcomp.reduction.reduced_model import ReducedModel
from gravcomp.reduction.tracking import ReducedState, ReducedTracker

# Largest tip error, as a fraction of the length, at which the reduced model serves; half of it lets it serve again.
_TOLERANCE = 1e-3
# Steps until the error is measured again, and at the least where the shape has moved by this share of the reach since.
_CHECK_EVERY, _CHECK_AT_LEAST, _CHECK_MOVED = 300, 20, 0.1
# Steps of the full model until the reduced one is tried again.
_RETURN_AFTER = 25


class ReducedServing:
    """Takes steps with the reduced model in place of the full one, and says when it cannot.

    Attributes: reduced, the model that serves. full: the solver of the full model, used for the checks; where the reduced model gives up, it is left at the last shape.
    """

    def __init__(self, model: RobotModel, reduced: ReducedModel, full: StaticSolver):
        self._model, self.reduced, self._full = model, reduced, full
        self._tolerance = _TOLERANCE * model.length
        self._tracker = ReducedTracker(reduced, model.length)
        self.reset()

    def reset(self) -> None:
        """Back to the straight robot, trusted."""
        self._tracker.place(np.zeros(self.reduced.size), np.zeros(self._model.tendons.count))
        self._error = self.reduced.error
        self._since_check = _CHECK_EVERY - _CHECK_AT_LEAST
        self._checked_at = self._tracker.state.q
        self._until_return = 0
        self.reason = ""

    @property
    def trusted(self) -> bool:
        """Whether the last step was the reduced model's, or the next one will be."""
        return not self.reason

    @property
    def displacements(self) -> np.ndarray:
        """(n, 3) displacements of the nodes at the reduced model's shape, in m."""
        u = np.zeros_like(self._model.mesh.nodes)
        self._model.free(u)[:] = self.reduced.basis @ self._tracker.state.q
        return u

    def step(self, gravity: np.ndarray, cables: CableInput) -> Shape | None:
        """The shape under gravity (3,) and the cables' input, following the last one; None when the full model has to give it."""
        if not self.trusted:
            return None
        started = time.perf_counter()
        state = self._tracker.track(gravity, cables, iterations=10)
        if not state.converged:
            return self._leave("the reduced model did not converge", wait=0)
        if self.reduced.outside(state.q) > 1.0:
            return self._leave("the shape is beyond what the reduced model was trained for", wait=_RETURN_AFTER)
        self._since_check += 1
        moved = state.q - self._checked_at
        far = moved @ moved > (_CHECK_MOVED * self.reduced.reach) ** 2 and self._since_check >= _CHECK_AT_LEAST
        if far or self._since_check >= _CHECK_EVERY:
            self._since_check, self._checked_at = 0, state.q
            self._error = self._measured_error(gravity, cables)
            if not self._error < self._tolerance:
                return self._leave(f"the reduced model's tip is off by {1e3 * self._error:.2f} mm", wait=_RETURN_AFTER)
        return self._shape(state, gravity, started)

    def take_over(self, state: Equilibrium, gravity: np.ndarray, cables: CableInput) -> None:
        """After a step of the full model: let the reduced one serve again when both agree."""
        self._until_return -= 1
        if self._until_return <= 0:
            self.follow(state, gravity, cables)

    def follow(self, state: Equilibrium, gravity: np.ndarray, cables: CableInput) -> None:
        """Go to a shape of the full model, and serve from there if both models agree on it."""
        self.reason = self.reason or "the shape is beyond what the reduced model was trained for"
        self._until_return = _RETURN_AFTER
        if not state.converged:
            return
        q = self.reduced.coordinates_of @ self._model.free(state.u)
        self._tracker.place(q, state.tension)
        own = self._tracker.track(gravity, cables, iterations=10)
        error = float(np.linalg.norm(self.reduced.tip(own.q) - self._tip(state.u)))
        if own.converged and self.reduced.outside(own.q) <= 1.0 and error < 0.5 * self._tolerance:
            self.reason, self._error, self._since_check, self._checked_at = "", error, 0, own.q

    def _leave(self, reason: str, wait: int) -> None:
        self.reason, self._until_return = reason, wait
        self._hand_over()

    def _hand_over(self) -> None:
        """Put the full model where the reduced one is."""
        u = self.displacements
        self._full.state = dataclasses.replace(
            self._full.state,
            u=u,
            tension=self._tracker.state.tension.copy(),
            tendons=self._model.tendons.state(self._model.mesh.nodes + u),
        )

    def _measured_error(self, gravity: np.ndarray, cables: CableInput) -> float:
        self._hand_over()
        before = self._tip(self._full.state.u)
        return float(np.linalg.norm(self._tip(self._full.track(gravity, cables, iterations=1).u) - before))

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
        )
