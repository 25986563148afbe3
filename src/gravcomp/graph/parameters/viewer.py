"""Parameters of the node viewer."""

import dataclasses

from gravcomp.config import parameter
from gravcomp.view.options import PageOptions


@dataclasses.dataclass(frozen=True)
class ViewerParameters(PageOptions):
    """What can be set on the node: the page's options, and what it does with what people ask for."""

    frame: str = parameter("soft_base", read_only=True, description="frame of the targets that the page sets")
    tip_direction_weight: float = parameter(
        1e-3,
        unit="m^2",
        minimum=0.0,
        maximum=10.0,
        description="of the targets that the page sets, beside a weight of 1 of the tip's position",
    )
    bag_folder: str = parameter(
        "", unit="path", read_only=True, description="where bags are recorded; empty: the folder it was started in"
    )
