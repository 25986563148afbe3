"""Parameters of the node viewer."""

import dataclasses

from gravcomp.config import parameter
from gravcomp.view.options import PageOptions


@dataclasses.dataclass(frozen=True)
class ViewerParameters(PageOptions):
    """Parameters of the node: the page's options, and those of its targets and bags."""

    frame: str = parameter("soft_base", read_only=True, description="frame of the targets that the page sets")
    tip_direction_weight: float | None = parameter(
        None,
        unit="m^2",
        minimum=0.0,
        maximum=10.0,
        description="weight of the tip direction in the targets that the page sets; the tip position has weight 1;"
        " none: a tenth of the square of the robot's length",
    )
    bag_folder: str = parameter(
        "", unit="path", read_only=True, description="folder of the recorded bags; empty: the current folder"
    )
