"""Parameters of the node judge."""

import dataclasses

from gravcomp.config import parameter


@dataclasses.dataclass(frozen=True)
class JudgeParameters:
    """What can be set on the node."""

    duration: float = parameter(
        30.0, unit="s", minimum=5.0, maximum=86400.0, read_only=True, description="of the run, from the first truth on"
    )
    relax_time: float = parameter(
        8.0, unit="s", minimum=0.0, maximum=3600.0, read_only=True, description="with released cables, before compensation begins"
    )
    settle_time: float = parameter(
        4.0,
        unit="s",
        minimum=0.0,
        maximum=600.0,
        read_only=True,
        description="after compensation began, not counted in the residual",
    )
    start_timeout: float = parameter(
        60.0, unit="s", minimum=1.0, maximum=600.0, read_only=True, description="for the first truth to come"
    )
    result_file: str = parameter(
        "", read_only=True, description="JSON file with the state of the run, renewed while it goes; empty: none"
    )
    nodes: tuple[str, ...] = parameter((), read_only=True, description="nodes whose lifecycle states are reported")
    measure_delay: bool = parameter(
        True, read_only=True, description="listen to the CAN bus for the delay from IMU to motor current"
    )
    interface: str = parameter(
        "", read_only=True, description="python-can interface; empty: hardware.can.interface of the robot's file"
    )
    channel: str = parameter("", read_only=True, description="its channel; empty: hardware.can.channel of the robot's file")
