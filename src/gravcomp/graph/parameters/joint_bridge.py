"""Parameters of the node joint_bridge."""

import dataclasses

from gravcomp.config import parameter


@dataclasses.dataclass(frozen=True)
class JointBridgeParameters:
    """Parameters of the node; the joints are described in the robot file under `hardware.joints`."""

    control_rate: float = parameter(
        250.0, unit="Hz", minimum=50, maximum=1000, description="rate of the messages to the controller", read_only=True
    )
    horizon: float = parameter(
        0.0,
        edge="ms",
        minimum=0,
        maximum=500,
        description="time_from_start of the point of each trajectory; 0: the controller goes there at its next update",
        read_only=True,
    )
    state_rate: float = parameter(50.0, unit="Hz", minimum=1, maximum=500, description="rate of cable/state", read_only=True)
    guard: bool = parameter(
        True,
        description="with a controller of efforts: drive only while a guard process runs, which sends zeros when the bridge dies",
        read_only=True,
    )
    require_imu: bool = parameter(
        False,
        description="subscribe to imu/data_raw and hold the cables when no samples arrive; without it, the stamps of the commands"
        " say how old their IMU samples are",
        read_only=True,
    )
