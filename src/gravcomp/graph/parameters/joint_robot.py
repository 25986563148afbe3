"""Parameters of the node joint_robot."""

import dataclasses

from gravcomp.config import parameter
from gravcomp.graph.parameters.shared import CanBusParameters


@dataclasses.dataclass(frozen=True)
class JointRobotParameters(CanBusParameters):
    """Parameters of the node; the joints are described in the robot file under `hardware.joints`."""

    joints: str = parameter(
        "virtual_robot",
        choices=("virtual_robot", "mock"),
        description="what is behind the controller: the motors of the virtual robot, or joints whose state is their command",
        read_only=True,
    )
    update_rate: float = parameter(
        250.0, unit="Hz", minimum=10, maximum=250, description="rate of the controller and of joint_states", read_only=True
    )
    imu_frame: str = parameter("imu_link", description="frame of the IMU messages", read_only=True)
