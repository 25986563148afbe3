"""Parameters of the node arm_player."""

import dataclasses

from gravcomp.config import parameter


@dataclasses.dataclass(frozen=True)
class ArmPlayerParameters:
    """The arm and its tour."""

    urdf: str = parameter(
        "", unit="path", read_only=True, description="URDF of the arm with the robot; its moving joints are played in their order"
    )
    world_frame: str = parameter("world", read_only=True, description="root of the arm in the URDF, z up")
    base_frame: str = parameter("soft_base", read_only=True, description="link of the robot's base in the URDF")
    wait: float = parameter(4.0, unit="s", minimum=0.0, maximum=600.0, read_only=True, description="at rest before the tour")
    travel: float = parameter(3.0, unit="s", minimum=0.5, maximum=600.0, read_only=True, description="from pose to pose")
    hold: float = parameter(5.0, unit="s", minimum=1.0, maximum=600.0, read_only=True, description="at each pose")
    measured: float = parameter(
        1.5,
        unit="s",
        minimum=0.1,
        maximum=60.0,
        read_only=True,
        description="at the end of each hold, over which the tip error is averaged",
    )
    result_file: str = parameter(
        "", unit="path", read_only=True, description="JSON file with the state of the tour, renewed while it goes; empty: none"
    )
