"""Parameters of the node judge."""

import dataclasses

from gravcomp.config import parameter


@dataclasses.dataclass(frozen=True)
class JudgeParameters:
    """Parameters of the node."""

    duration: float = parameter(
        30.0,
        unit="s",
        minimum=5.0,
        maximum=86400.0,
        read_only=True,
        description="duration of the run, from the first ground truth on",
    )
    relax_time: float = parameter(
        8.0,
        unit="s",
        minimum=0.0,
        maximum=3600.0,
        read_only=True,
        description="time with released cables before compensation begins",
    )
    settle_time: float = parameter(
        4.0,
        unit="s",
        minimum=0.0,
        maximum=600.0,
        read_only=True,
        description="time after the start of compensation that is not counted in the residual",
    )
    start_timeout: float = parameter(
        60.0, unit="s", minimum=1.0, maximum=600.0, read_only=True, description="longest wait for the first ground truth"
    )
    result_file: str = parameter(
        "", read_only=True, description="JSON file with the current state and figures, rewritten during the run; empty: none"
    )
    seed: int = parameter(
        -1, minimum=-1, maximum=2**31 - 1, read_only=True, description="seed of the virtual robot; -1: the one of the robot file"
    )
    nodes: tuple[str, ...] = parameter((), read_only=True, description="nodes whose lifecycle states are reported")
    measure_delay: bool = parameter(
        True, read_only=True, description="measure the delay from IMU sample to motor current on the CAN bus"
    )
    standalone: bool = parameter(
        False,
        read_only=True,
        description="compensation is that of the loop on the board: the bridge is stopped, and the board asked to run",
    )
    interface: str = parameter(
        "", read_only=True, description="python-can interface; empty: hardware.can.interface of the robot file"
    )
    channel: str = parameter(
        "",
        read_only=True,
        description="CAN channel, with several buses one each, by commas; empty: as in hardware of the robot file",
    )
