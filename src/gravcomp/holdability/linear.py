"""A first estimate of the tensions that keep the robot's shape at rest, from its linear response there to gravity and cables.

One factorisation gives the responses to gravity along three axes and to every cable; then each direction of gravity takes one
quadratic programme. The linear response of a soft robot sags by many times its length, where the solver's accuracy is out of
reach. So a programme has no more gravity than lets the tip sag by the length; gravity, limits and answer are scaled alike.
"""

import dataclasses

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
        times = max(1.0, float(np.linalg.norm(self._by_gravity[:3] @ gravity)) / self._model.length)
        part = gravity / times
        response = Response(
            self._compliance, self._by_tension, self._path_by_gravity @ part, self._effector + self._by_gravity @ part
        )
        self._solver.reset()  # the answer does not depend on the order of the directions
        programme = build_programme(
            response,
            self._target,
            _scaled(self._limits, 1.0 / times),
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
        tension = times * tension
        error = self._by_tension[:3] @ tension + self._by_gravity[:3] @ gravity
        return tension, float(np.linalg.norm(error - (error @ self._along) * self._along))


def _scaled(limits: Limits, factor: float) -> Limits:
    """The limits of tension and displacement, times a factor."""
    return dataclasses.replace(
        limits,
        tension_min=factor * limits.tension_min,
        tension_max=factor * limits.tension_max,
        displacement_min=factor * limits.displacement_min,
        displacement_max=factor * limits.displacement_max,
    )
