"""Parameters of the node fem_simulator."""

import dataclasses

from gravcomp.config import parameter


@dataclasses.dataclass(frozen=True)
class FemSimulatorParameters:
    """What can be set on the node; the robot itself is in its file under `robot`."""

    cables_from: str = parameter(
        "command",
        choices=("command", "state"),
        read_only=True,
        description="what drives the model's cables: what was commanded, or what the motors measure",
    )
    mode: str = parameter(
        "static",
        choices=("static", "dynamic"),
        read_only=True,
        description="the shape of equilibrium, or of the motion toward it from stamp to stamp (full model: several ms a sample)",
    )
    marker_rate: float = parameter(10.0, unit="Hz", minimum=0.0, maximum=10.0, description="of robot/markers and TF; 0: none")
    base_frame: str = parameter("soft_base", description="frame of the shape", read_only=True)
    tip_frame: str = parameter("soft_tip", description="TF frame of the tip", read_only=True)
