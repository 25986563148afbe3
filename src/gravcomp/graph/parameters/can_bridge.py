"""Parameters of the node can_bridge."""

import dataclasses

from gravcomp.config import parameter
from gravcomp.graph.parameters.shared import CanBusParameters
from gravcomp.motors.bridge import ZERO_POLICIES


@dataclasses.dataclass(frozen=True)
class CanBridgeParameters(CanBusParameters):
    """Parameters of the node; the motors are described in the robot file under `hardware`."""

    control_rate: float = parameter(
        250.0, unit="Hz", minimum=200, maximum=1000, description="rate of the position loops", read_only=True
    )
    state_rate: float = parameter(
        50.0, unit="Hz", minimum=1, maximum=500, description="rate of cable/state and joint_states", read_only=True
    )
    zero: str = parameter(
        "start",
        choices=ZERO_POLICIES,
        read_only=True,
        description="zero positions of the cables when none are stored: the current positions (start), unknown until ~/home is "
        "called (home), found by homing at activation (home_at_start)",
    )
    require_imu: bool = parameter(True, description="hold the cables when no IMU samples arrive", read_only=True)
    guard: bool = parameter(
        True, description="drive only while a guard process runs, which zeroes the currents when the bridge dies", read_only=True
    )
    trace: bool = parameter(True, description="send CommandTrace frames, from which delays are measured", read_only=True)
    imu_frame: str = parameter("imu_link", description="frame of the IMU messages", read_only=True)
