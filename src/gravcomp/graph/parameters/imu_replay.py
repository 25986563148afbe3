"""Parameters of the node imu_replay."""

from dataclasses import dataclass

from gravcomp.config import parameter


@dataclass(frozen=True)
class ImuReplayParameters:
    """What is played, and how."""

    file: str = parameter("", description="rosbag2 folder (MCAP or SQLite) or .npz file in BROAD's layout", read_only=True)
    topic: str = parameter("", description="the IMU topic, for a bag with several; empty: the only one", read_only=True)
    rate: float = parameter(
        1.0, minimum=0, maximum=1000, description="times real time; 0: as fast as it is taken", read_only=True
    )
    loop: bool = parameter(False, description="start again at the end, with stamps that go on", read_only=True)
    exit_at_end: bool = parameter(True, description="end the process after the last sample", read_only=True)
    wait_for_subscribers: float = parameter(
        10.0,
        unit="s",
        minimum=0,
        maximum=600,
        read_only=True,
        description="how long the first sample waits for someone who takes it reliably",
    )
    wait_for: tuple[str, ...] = parameter(
        (), read_only=True, description="nodes of the namespace that the first sample waits for, too"
    )
    clock: bool = parameter(True, description="publish /clock", read_only=True)
    imu_frame: str = parameter("imu_link", description="frame of the IMU messages", read_only=True)
