"""Parameters of the node arm_gravity."""

import dataclasses

from gravcomp.config import parameter


@dataclasses.dataclass(frozen=True)
class ArmGravityParameters:
    """Where the arm's pose comes from, and what is done with gravity from it."""

    use: str = parameter(
        "check",
        choices=("check", "publish"),
        read_only=True,
        description="compare with the IMU's gravity, or publish gravity itself, in place of imu_estimator",
    )
    source: str = parameter(
        "joint_states",
        choices=("joint_states", "tf"),
        read_only=True,
        description="the joints' positions and the URDF, or TF (needs tf2_msgs, that is a ROS installation)",
    )
    urdf: str = parameter(
        "", unit="path", read_only=True, description="URDF with arm and robot; empty: the topic robot_description"
    )
    world_frame: str = parameter(
        "world", read_only=True, description="frame whose z points up; the link or TF frame that carries the arm"
    )
    base_frame: str = parameter("soft_base", read_only=True, description="the robot's base in the URDF or in TF")
    tolerance: float = parameter(
        3.0, edge="deg", minimum=0.05, maximum=90.0, description="between both directions of gravity, beyond that they disagree"
    )
    patience: float = parameter(0.5, unit="s", minimum=0.0, maximum=60.0, description="how long they may, before it is reported")
