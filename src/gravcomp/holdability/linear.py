"""A first estimate of the tensions that keep the robot's shape at rest, from its linear response there to gravity and cables.

One factorisation gives the responses to gravity along three axes and to every cable; then each direction of gravity takes one
quadratic programme.
"""

import numpy as np

from gravcomp.description import Limits
from gravcomp.full_model.observation import observe
from gravcomp.full_model.robot_model import RobotModel
from gravcomp.full_model.shape import Response
from gravcomp.inverse.options import InverseOptions
from gravcomp.inverse.programme import build_programme
from gravcomp.inverse.rest_target import rest_target
from gravcomp.inverse.scaling import unscaled
from gravcomp.inverse.solver import ProgrammeSolver

_INVERSE = InverseOptions(axial_weight=0.0, proximal_weight=0.0)


class LinearHolding:
    """The linear response of the robot at rest, for any direction of gravity."""

    def __init__(self, model: RobotModel, answer: np.ndarray, limits: Limits):
        """answer (3 n_free, 3 + m): as `Tangent.answer`; limits: within which tensions are searched for, without rates."""
        self._model, self._limits = model, limits
        sections = model.effectors.sections(model.mesh.nodes)
        self._effector, change, _ = observe(sections, model.effectors.section_changes(answer))
        self._by_gravity, self._by_tension = change[:, :3], np.ascontiguousarray(change[:, 3:])
        tendons = model.tendons.state(model.mesh.nodes)
        lengths = tendons.jacobian @ answer
        self._path_by_gravity = lengths[:, :3]
        self._compliance = lengths[:, 3:] + np.diag(model.tendons.stretch(tendons))
        self._target = rest_target(model.robot)
        self._along = self._target.direction_or_zeros
        self._solver = ProgrammeSolver()

    def tension(self, gravity: np.ndarray) -> tuple[np.ndarray, float]:
        """Return the tensions (m,) in N that hold the tip under gravity (3,), and the lateral error that remains, in m."""
        count = len(self._compliance)
        zero = np.zeros(count)
        response = Response(
            self._compliance, self._by_tension, self._path_by_gravity @ gravity, self._effector + self._by_gravity @ gravity
        )
        self._solver.reset()  # the answer does not depend on the order of the directions
        programme = build_programme(
            response,
            self._target,
            self._limits,
            tension=zero,
            displacement=zero,
            backbone_station=self._model.effectors.station,
            interval=1.0,
            damping=1.0,
            options=_INVERSE,
        )
        solution = self._solver.solve(programme)
        tension, _ = unscaled(
            solution.unknowns, solution.multipliers, programme.scale, programme.tension_lower, programme.tension_upper
        )
        error = self._by_tension[:3] @ tension + self._by_gravity[:3] @ gravity
        return tension, float(np.linalg.norm(error - (error @ self._along) * self._along))
