"""What is observed of a state of the full model, and its linear response to the cables."""

from typing import NamedTuple

import numpy as np

from gravcomp.full_model.equilibrium import Equilibrium
from gravcomp.full_model.observation import observe
from gravcomp.full_model.robot_model import RobotModel
from gravcomp.full_model.shape import Response


class Observed(NamedTuple):
    """What is observed of a state.

    sections (n + 1, 3, 3): as in `Effectors.sections`; orientation (n + 1, 4) of them as quaternions x y z w; effector (e,);
    displacement (m,) of the cables in m; response: to the cables.
    """

    sections: np.ndarray
    orientation: np.ndarray
    effector: np.ndarray
    displacement: np.ndarray
    response: Response


def observed(model: RobotModel, state: Equilibrium) -> Observed:
    """Return what is observed of a state of the model."""
    sections = model.effectors.sections(model.mesh.nodes + state.u)
    effector, compliance_ea, orientation = observe(sections, model.effectors.section_changes(state.answer))
    displacement = state.tendons.displacement + model.tendons.stretch(state.tendons) * state.tension
    response = Response(
        state.compliance,
        compliance_ea,
        displacement - state.compliance @ state.tension,
        effector - compliance_ea @ state.tension,
    )
    return Observed(sections, orientation, effector, displacement, response)
