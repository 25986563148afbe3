"""Parameters of the node imu_replay."""

from dataclasses import dataclass

from gravcomp.config import parameter


@dataclass(frozen=True)
class ImuReplayParameters:
    """Parameters of the node."""

    file: str = parameter("", description="rosbag2 folder (MCAP or SQLite), .npz file in BROAD's layout, or CSV", read_only=True)
    topic: str = parameter("", description="IMU topic of a bag that has several; empty: the only one", read_only=True)
    rate: float = parameter(
        1.0,
        minimum=0,
        maximum=1000,
        description="speed as a multiple of real time; 0: as fast as the subscribers take the samples",
        read_only=True,
    )
    loop: bool = parameter(False, description="start again at the end, with increasing stamps", read_only=True)
    exit_at_end: bool = parameter(True, description="end the process after the gravity of the last sample", read_only=True)
    wait_for_subscribers: float = parameter(
        10.0,
        unit="s",
        minimum=0,
        maximum=600,
        read_only=True,
        description="longest wait for a reliable subscriber before the first sample",
    )
    wait_for: tuple[str, ...] = parameter(
        (), read_only=True, description="nodes of the namespace that must run before the first sample"
    )
    clock: bool = parameter(True, description="publish /clock", read_only=True)
    imu_frame: str = parameter("imu_link", description="frame of the IMU messages", read_only=True)
