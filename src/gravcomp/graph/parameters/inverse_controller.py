"""Parameters of the node inverse_controller."""

import dataclasses

from gravcomp.config import parameter
from gravcomp.inverse.options import InverseOptions


@dataclasses.dataclass(frozen=True)
class InverseControllerParameters:
    """What can be set on the node; the cables' limits are in the robot's file under `robot.limits`."""

    enabled: bool = parameter(True, description="send commands, as by ~/enable")
    hold_straight: bool = parameter(True, description="keep the robot straight until the first target comes")
    tip_position_weight: float = parameter(
        1.0, minimum=0.0, maximum=1e3, description="of a target that is a pose, and of the straight robot"
    )
    tip_direction_weight: float = parameter(
        1e-3, unit="m^2", minimum=0.0, maximum=10.0,
        description="of a pose and of the straight robot: 0.001 makes 0.1 rad count like 3 mm; 0 leaves the direction free",
    )  # fmt: skip
    stale_after: float = parameter(
        200.0, edge="ms", minimum=20.0, maximum=10000.0, description="without robot/deformation, until no command is sent"
    )
    frame: str = parameter("soft_base", description="frame that targets have to be given in", read_only=True)
    inverse: InverseOptions = parameter(
        default_factory=InverseOptions, description="how the inverse problem weighs exactness against effort"
    )
