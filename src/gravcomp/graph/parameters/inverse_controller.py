"""Parameters of the node inverse_controller."""

import dataclasses

from gravcomp.config import parameter
from gravcomp.inverse.options import InverseOptions
from gravcomp.inverse.target import LARGEST_WEIGHT
from gravcomp.tip_observer.options import TipObserverOptions


@dataclasses.dataclass(frozen=True)
class InverseControllerParameters:
    """Parameters of the node; the limits of the cables are in the robot file under `robot.limits`."""

    enabled: bool = parameter(True, description="send commands; ~/enable changes it")
    hold_straight: bool = parameter(True, description="keep the shape at rest, straight or bent, until the first target arrives")
    tip_position_weight: float = parameter(
        1.0,
        minimum=0.0,
        maximum=LARGEST_WEIGHT,
        description="weight of the tip position for a target pose and for the shape at rest",
    )
    tip_direction_weight: float | None = parameter(
        None, unit="m^2", minimum=0.0, maximum=10.0,
        description="weight of the tip direction for both: 0.001 makes 0.1 rad count like 3 mm; 0: direction free;"
        " none: a tenth of the square of the robot's length",
    )  # fmt: skip
    stale_after: float = parameter(
        200.0, edge="ms", minimum=20.0, maximum=10000.0, description="without robot/deformation for this time no command is sent"
    )
    check_hold: bool = parameter(
        True,
        description="find out at start, in a process of low priority, whether the cables can hold the target",
        read_only=True,
    )
    frame: str = parameter("soft_base", description="frame in which targets must be given", read_only=True)
    inverse: InverseOptions = parameter(
        default_factory=InverseOptions, description="weights and tolerances of the inverse problem"
    )
    tracker: TipObserverOptions = parameter(
        default_factory=TipObserverOptions, description="correction of the model's error by measured/tip"
    )
