"""Parameters of the node arm_player."""

import dataclasses

from gravcomp.config import parameter


@dataclasses.dataclass(frozen=True)
class ArmPlayerParameters:
    """The arm and its motion through the poses."""

    urdf: str = parameter(
        "", unit="path", read_only=True, description="URDF of the arm with the robot; its moving joints are used in their order"
    )
    world_frame: str = parameter("world", read_only=True, description="root link of the arm in the URDF; its z axis points up")
    base_frame: str = parameter("soft_base", read_only=True, description="link of the robot's base in the URDF")
    wait: float = parameter(4.0, unit="s", minimum=0.0, maximum=600.0, read_only=True, description="rest before the first motion")
    travel: float = parameter(
        3.0, unit="s", minimum=0.5, maximum=600.0, read_only=True, description="duration of the motion from one pose to the next"
    )
    hold: float = parameter(5.0, unit="s", minimum=1.0, maximum=600.0, read_only=True, description="rest at each pose")
    measured: float = parameter(
        1.5,
        unit="s",
        minimum=0.1,
        maximum=60.0,
        read_only=True,
        description="final part of each rest, over which the tip error is averaged",
    )
    result_file: str = parameter(
        "",
        unit="path",
        read_only=True,
        description="JSON file with the current state and figures, rewritten during the run; empty: none",
    )
