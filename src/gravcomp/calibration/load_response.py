"""Linear response of the tip to forces on the body, with the taut cables held by their motors.

At an equilibrium with tangent K, cables with the Jacobian H, the forces H_f^T lambda and the stretch c, small forces F move the
unknowns by du and change the tensions of the taut cables a by dl:

    K du = F + H_f,a^T dl,    H_a du + c_a dl = 0.
"""

import numpy as np

from gravcomp.calibration.walk import Step
from gravcomp.full_model.observation import observe
from gravcomp.full_model.robot_model import RobotModel


class LoadResponse:
    """Computes the responses of one model. Owns a stiffness matrix."""

    def __init__(self, model: RobotModel):
        self._model, self._matrix = model, model.new_matrix()

    def tips(self, step: Step, forces: np.ndarray) -> np.ndarray:
        """Return the change (6, q) of position and direction of the tip by each of the forces (3 n_free, q).

        step: with its result. Raises NotPositiveDefinite where the robot would not be stable without its motors.
        """
        model, state = self._model, step.state
        assert state is not None
        self._matrix.values[:] = 0.0
        model.elements.assemble(state.u, self._matrix, step.viscous)
        taut = state.tension > 0.0
        if taut.any():
            model.tendons.add_stiffness(state.tendons, state.tension, self._matrix)
        pull, pulled = state.tendons.force_jacobian[taut].T, state.tendons.jacobian[taut]
        solved = self._matrix.factor().solve(np.column_stack([forces, pull]))
        moved, by_tension = solved[:, : forces.shape[1]], solved[:, forces.shape[1] :]
        if taut.any():
            own = pulled @ by_tension + np.diag(model.tendons.stretch(state.tendons)[taut])
            moved = moved - by_tension @ np.linalg.solve(own, pulled @ moved)
        sections = model.effectors.sections(model.mesh.nodes + state.u)
        changes: np.ndarray = observe(sections, model.effectors.section_changes(moved))[1][:6]
        return changes

    def elastic_forces(self, step: Step, which: np.ndarray) -> np.ndarray:
        """Return what the elements of each row of `which` (s, k) pull back with: the forces (3 n_free, s) on the unknowns."""
        model, state = self._model, step.state
        assert state is not None
        whole = model.elements.internal_force(state.u, step.viscous)
        found = []
        for own in which:
            # Forces are proportional to the moduli: twice those of some elements add what these have.
            model.elements.scale_stiffness(np.where(own, 2.0, 1.0))
            found.append(model.free(whole - model.elements.internal_force(state.u, step.viscous)))
            model.elements.scale_stiffness(np.where(own, 0.5, 1.0))
        return np.column_stack(found)
