"""Parameters that every node has, and those of every node on the CAN bus."""

from dataclasses import dataclass

from gravcomp.config import parameter


@dataclass(frozen=True)
class SharedParameters:
    """Parameters of every node."""

    robot: str = parameter("article", read_only=True, description="name of a shipped robot or path of a robot file")
    autostart: bool = parameter(True, read_only=True, description="configure and activate at start, without a lifecycle manager")


@dataclass(frozen=True)
class CanBusParameters:
    """CAN buses in place of the robot file's."""

    interface: str = parameter(
        "", description="python-can interface; empty: hardware.can.interface of the robot file", read_only=True
    )
    channel: str = parameter(
        "",
        description="CAN channel, with several buses one each, by commas; empty: as in hardware of the robot file",
        read_only=True,
    )
