"""Parameters of the node arm_gravity."""

import dataclasses

from gravcomp.config import parameter


@dataclasses.dataclass(frozen=True)
class ArmGravityParameters:
    """Source of the arm's pose, and use of the gravity computed from it."""

    use: str = parameter(
        "check",
        choices=("check", "publish"),
        read_only=True,
        description="check: compare with the IMU's gravity; publish: publish gravity in place of imu_estimator",
    )
    source: str = parameter(
        "joint_states",
        choices=("joint_states", "tf"),
        read_only=True,
        description="joint_states: joint positions and URDF; tf: TF (needs tf2_msgs, that is a ROS installation)",
    )
    urdf: str = parameter(
        "", unit="path", read_only=True, description="URDF with arm and robot; empty: from the topic robot_description"
    )
    world_frame: str = parameter(
        "world", read_only=True, description="link or TF frame that carries the arm; its z axis points up"
    )
    base_frame: str = parameter("soft_base", read_only=True, description="link or TF frame of the robot's base")
    tolerance: float = parameter(
        3.0,
        edge="deg",
        minimum=0.05,
        maximum=90.0,
        description="largest angle between the gravity of arm and IMU at which they agree",
    )
    patience: float = parameter(
        0.5, unit="s", minimum=0.0, maximum=60.0, description="a disagreement that lasts longer is reported"
    )
