"""Parameters of the node virtual_robot."""

import dataclasses

from gravcomp.config import parameter

MOTIONS = ("static", "tilt", "arm", "tremor", "rotation", "recording", "topic")


@dataclasses.dataclass(frozen=True)
class VirtualRobotNodeParameters:
    """What can be set on the node; what the virtual robot is stands in the robot's file under `virtual_robot`."""

    interface: str = parameter(
        "", description="python-can interface; empty: hardware.can.interface of the robot's file", read_only=True
    )
    channel: str = parameter("", description="its channel; empty: hardware.can.channel of the robot's file", read_only=True)
    seed: int = parameter(
        -1, minimum=-1, maximum=2**31 - 1, description="of everything random; -1: the robot file's", read_only=True
    )
    motion: str = parameter(
        "static",
        choices=MOTIONS,
        read_only=True,
        description="of the base: standing still, tilting after a hold, the five poses of an arm, a hand's tremor, a steady rotation, "
        "as a recording's ground truth, or following virtual/base_orientation",
    )
    steerable: bool = parameter(
        False,
        read_only=True,
        description="virtual/base_orientation takes the base over from any motion, as it always does with motion topic",
    )
    inclination: float = parameter(
        0.0,
        edge="deg",
        minimum=-180.0,
        maximum=180.0,
        description="of the base at the start: 0 horizontal, 90 up",
        read_only=True,
    )
    roll: float = parameter(
        0.0, edge="deg", minimum=-360.0, maximum=360.0, description="about the robot's axis at the start", read_only=True
    )
    hold: float = parameter(
        10.0,
        unit="s",
        minimum=0.0,
        maximum=3600.0,
        description="standing still before tilt, arm and rotation begin",
        read_only=True,
    )
    rate: float = parameter(
        23.0, edge="deg/s", minimum=0.1, maximum=360.0, description="angular speed of tilt, arm and rotation", read_only=True
    )
    axis: str = parameter(
        "vertical", choices=("vertical", "robot", "across"), read_only=True, description="what motion rotation turns about"
    )
    recording: str = parameter(
        "",
        description="IMU recording with ground truth for motion recording: .npz in BROAD's layout or a rosbag2 folder",
        read_only=True,
    )
    recording_start: float = parameter(
        0.0, unit="s", minimum=0.0, maximum=86400.0, description="from where on the recording is played", read_only=True
    )
    feedback_rate: int = parameter(
        0, unit="Hz", choices=(0, 125, 250, 500, 1000), description="of each motor; 0: the robot file's", read_only=True
    )
    truth_rate: float = parameter(100.0, unit="Hz", minimum=1.0, maximum=500.0, description="of the truth topics", read_only=True)
    base_frame: str = parameter("soft_base", description="frame of truth/tip, truth/backbone and truth/gravity", read_only=True)
