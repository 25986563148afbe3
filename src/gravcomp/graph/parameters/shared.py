"""Parameters that every node has."""

from dataclasses import dataclass

from gravcomp.config import parameter


@dataclass(frozen=True)
class SharedParameters:
    """Parameters of every node."""

    robot: str = parameter("article", read_only=True, description="name of a shipped robot or path of a robot file")
    autostart: bool = parameter(True, read_only=True, description="configure and activate at start, without a lifecycle manager")
