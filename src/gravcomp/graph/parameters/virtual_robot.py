"""Parameters of the node virtual_robot."""

import dataclasses

from gravcomp.config import parameter
from gravcomp.graph.boards import BOARDS
from gravcomp.graph.parameters.shared import CanBusParameters
from gravcomp.graph.parameters.virtual_load_cells import VirtualLoadCellParameters
from gravcomp.graph.parameters.virtual_tracker import VirtualTrackerParameters

MOTIONS = ("static", "tilt", "arm", "tremor", "rotation", "recording", "topic")


@dataclasses.dataclass(frozen=True)
class VirtualRobotNodeParameters(CanBusParameters):
    """Parameters of the node; the virtual robot is described in the robot file under `virtual_robot`."""

    seed: int = parameter(
        -1, minimum=-1, maximum=2**31 - 1, description="seed of all random numbers; -1: the one of the robot file", read_only=True
    )
    motion: str = parameter(
        "static",
        choices=MOTIONS,
        read_only=True,
        description="motion of the base: at rest, tilt, five poses of an arm, tremor of a hand, steady rotation, "
        "ground truth of a recording, or virtual/base_orientation",
    )
    steerable: bool = parameter(
        False,
        read_only=True,
        description="virtual/base_orientation overrides any motion",
    )
    inclination: float = parameter(
        0.0,
        edge="deg",
        minimum=-180.0,
        maximum=180.0,
        description="inclination of the base at start: 0 horizontal, 90 up",
        read_only=True,
    )
    roll: float = parameter(
        0.0, edge="deg", minimum=-360.0, maximum=360.0, description="roll about the robot's axis at start", read_only=True
    )
    hold: float = parameter(
        10.0,
        unit="s",
        minimum=0.0,
        maximum=3600.0,
        description="rest before tilt, arm and rotation begin",
        read_only=True,
    )
    rate: float = parameter(
        23.0, edge="deg/s", minimum=0.1, maximum=360.0, description="angular speed of tilt, arm and rotation", read_only=True
    )
    axis: str = parameter(
        "vertical", choices=("vertical", "robot", "across"), read_only=True, description="axis of motion rotation"
    )
    recording: str = parameter(
        "",
        description="IMU recording with ground truth for motion recording: .npz in BROAD's layout or a rosbag2 folder",
        read_only=True,
    )
    recording_start: float = parameter(
        0.0, unit="s", minimum=0.0, maximum=86400.0, description="time in the recording at which playback starts", read_only=True
    )
    feedback_rate: int = parameter(
        0,
        unit="Hz",
        choices=(0, 125, 250, 500, 1000),
        description="feedback rate of each motor; 0: the one of the robot file",
        read_only=True,
    )
    board: str = parameter(
        "virtual",
        choices=BOARDS,
        read_only=True,
        description="board of the virtual robot: Python code; the firmware's C code, which also limits the currents; or that with"
        " the loop on the board, which begins when a host asks it to run",
    )
    truth_rate: float = parameter(
        100.0, unit="Hz", minimum=1.0, maximum=500.0, description="rate of the topics truth/...", read_only=True
    )
    base_frame: str = parameter("soft_base", description="frame of truth/... and measured/tip", read_only=True)
    tracker: VirtualTrackerParameters = parameter(
        default_factory=VirtualTrackerParameters, description="tracker of the tip, which publishes measured/tip"
    )
    load_cells: VirtualLoadCellParameters = parameter(
        default_factory=VirtualLoadCellParameters, description="load cells at the capstans, which publish measured/tension"
    )
