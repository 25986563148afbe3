"""Parameters of the node arm_gravity."""

import dataclasses

from gravcomp.config import parameter


@dataclasses.dataclass(frozen=True)
class ArmGravityParameters:
    """Source of the arm's pose, and use of the gravity computed from it."""

    use: str = parameter(
        "check",
        choices=("check", "publish", "fuse"),
        read_only=True,
        description="check: compare with the IMU's gravity; publish: publish gravity in place of imu_estimator; fuse: publish the"
        " gravity of arm and IMU together, with imu_estimator's gravity remapped to gravity/imu",
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
    feed_acceleration: bool = parameter(
        False,
        read_only=True,
        description="publish the acceleration of the IMU from the arm's joints as arm/acceleration (source: joint_states)",
    )
    tolerance: float = parameter(
        3.0,
        edge="deg",
        minimum=0.05,
        maximum=90.0,
        description="largest angle between the gravity of arm and IMU at which they agree",
    )
    imu_std: float = parameter(
        0.5, edge="deg", minimum=0.01, maximum=45.0, description="standard deviation of the IMU's gravity (use: fuse)"
    )
    arm_std: float = parameter(
        0.5,
        edge="deg",
        minimum=0.01,
        maximum=45.0,
        description="standard deviation of the arm's gravity, with that of the mount and the arm's base (use: fuse)",
    )
    patience: float = parameter(
        0.5, unit="s", minimum=0.0, maximum=60.0, description="a disagreement that lasts longer is reported"
    )
