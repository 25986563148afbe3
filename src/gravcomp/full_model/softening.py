"""Whether a body is compressed so strongly that its material law softens."""

import numpy as np

from gravcomp.full_model.model import RobotModel
from gravcomp.materials.laws import LAWS
from gravcomp.mechanics.corotational import CorotationalElements


def softened(model: RobotModel, u: np.ndarray, part: float = 1.0) -> str | None:
    """Return a sentence about the material that softens at the displacements u (n, 3); None if none does.

    part: of the strain at which it softens; less than 1 for a shape shortly before that.
    """
    mesh, elements = model.mesh, model.elements
    if isinstance(elements, CorotationalElements):
        return None
    for number, material in enumerate(mesh.materials):
        softening, own = LAWS[material.law].softening_strain, mesh.region == number
        least = elements.strains(u)[own, :, :3].min(initial=0.0)
        if softening is not None and least < part * softening:
            return (
                f"the body is compressed to {100 * np.sqrt(1 + 2 * least):.0f} % of its length at a point,"
                f" where the law '{material.law}' softens; choose another law for such loads"
            )
    return None
