"""Parameters of the node can_bridge."""

import dataclasses

from gravcomp.config import parameter
from gravcomp.motors.bridge import ZERO_POLICIES


@dataclasses.dataclass(frozen=True)
class CanBridgeParameters:
    """What can be set on the node; the motors are in the robot's file under `hardware`."""

    interface: str = parameter(
        "", description="python-can interface; empty: hardware.can.interface of the robot's file", read_only=True
    )
    channel: str = parameter("", description="its channel; empty: hardware.can.channel of the robot's file", read_only=True)
    control_rate: float = parameter(
        250.0, unit="Hz", minimum=200, maximum=1000, description="of the position loops", read_only=True
    )
    state_rate: float = parameter(
        50.0, unit="Hz", minimum=1, maximum=500, description="of cable/state and joint_states", read_only=True
    )
    zero: str = parameter(
        "start",
        choices=ZERO_POLICIES,
        read_only=True,
        description="where the zero of the cables is when nobody knows: where they are (start), unknown until ~/home (home), "
        "found by homing at activation (home_at_start)",
    )
    require_imu: bool = parameter(True, description="hold when there are no IMU samples", read_only=True)
    guard: bool = parameter(True, description="drive only beside a guard process that zeroes the currents", read_only=True)
    trace: bool = parameter(True, description="send CommandTrace frames, by which delays are measured", read_only=True)
    imu_frame: str = parameter("imu_link", description="frame of the IMU messages", read_only=True)
