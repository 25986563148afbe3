"""Whether a shape is within the range of its materials' laws: compressed no farther than where the force on a fibre falls."""

import numpy as np

from gravcomp.full_model.robot_model import RobotModel
from gravcomp.materials.laws import LAWS
from gravcomp.mechanics.corotational import CorotationalElements


def beyond_range(model: RobotModel, u: np.ndarray, part: float = 1.0) -> str:
    """Return what is compressed too far at displacements u (n, 3), as a sentence; empty where nothing is.

    part: of the strain at which a law softens; less than 1 for a shape shortly before that.
    """
    mesh, elements = model.mesh, model.elements
    if isinstance(elements, CorotationalElements) or all(LAWS[m.law].softening_strain is None for m in mesh.materials):
        return ""
    strains = elements.strains(u)[..., :3]
    for number, material in enumerate(mesh.materials):
        softening = LAWS[material.law].softening_strain
        least = strains[mesh.region == number].min(initial=0.0)
        if softening is not None and least < part * softening:
            stretch, limit = (100 * np.sqrt(max(1 + 2 * strain, 0.0)) for strain in (least, softening))
            return (
                f"the body is compressed to {stretch:.0f} % of its length at a point, where the law '{material.law}' softens"
                f" (below {limit:.0f} %); choose another law for such loads"
            )
    return ""
