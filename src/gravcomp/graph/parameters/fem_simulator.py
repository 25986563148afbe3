"""Parameters of the node fem_simulator."""

import dataclasses

from gravcomp.config import parameter
from gravcomp.external_loads.options import BaseTurnOptions, ExternalLoadOptions
from gravcomp.load_estimation.options import LoadEstimationOptions


@dataclasses.dataclass(frozen=True)
class FemSimulatorParameters:
    """Parameters of the node; the robot is described in its file under `robot`."""

    cables_from: str = parameter(
        "command",
        choices=("command", "state"),
        read_only=True,
        description="source of the model's cable displacements: the commands, or the motors' measurements",
    )
    mode: str = parameter(
        "static",
        choices=("static", "dynamic"),
        read_only=True,
        description="static: equilibrium shape; dynamic: motion from stamp to stamp (full model: several ms a sample)",
    )
    marker_rate: float = parameter(
        10.0, unit="Hz", minimum=0.0, maximum=10.0, description="rate of robot/markers and TF; 0: neither is published"
    )
    shape_joints: bool = parameter(
        False,
        description="publish the shape as the joints of the URDF's chain in joint_states, at marker_rate",
        read_only=True,
    )
    joint_prefix: str = parameter("", description="prefix of the joints of shape_joints, as in the URDF", read_only=True)
    base_frame: str = parameter("soft_base", description="frame of the shape", read_only=True)
    tip_frame: str = parameter("soft_tip", description="TF frame of the tip", read_only=True)
    payload_mass: float = parameter(
        -1.0,
        edge="g",
        minimum=-1.0,
        maximum=1e5,
        description="payload at the tip, ramped when it changes; -1: that of the robot file",
    )
    external: ExternalLoadOptions = parameter(
        default_factory=ExternalLoadOptions, description="loads of external/wrench, and how fast loads come and go"
    )
    load: LoadEstimationOptions = parameter(
        default_factory=LoadEstimationOptions, description="an unknown load that is found from measured/tip and measured/tension"
    )
    turn: BaseTurnOptions = parameter(
        default_factory=BaseTurnOptions, description="what the turns of the base add to gravity while they last"
    )
