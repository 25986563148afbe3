"""Parameters that every node has."""

from dataclasses import dataclass

from gravcomp.config import parameter


@dataclass(frozen=True)
class SharedParameters:
    """Which robot, and whether the node goes active by itself."""

    robot: str = parameter("article", read_only=True, description="a shipped robot's name or the path of a robot's YAML")
    autostart: bool = parameter(
        True, read_only=True, description="configure and activate at the start, without a lifecycle manager"
    )
