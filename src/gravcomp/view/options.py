"""Address, contents and look of the page."""

import dataclasses

from gravcomp.config import parameter
from gravcomp.view.graphics import AUTO, GRAPHICS


@dataclasses.dataclass(frozen=True)
class LumenOptions:
    """The wall of a channel around the robot; it is only drawn."""

    diameter: float = parameter(
        0.0, edge="mm", minimum=0.0, maximum=1000.0, read_only=True, description="inner diameter; 0: none"
    )
    length: float = parameter(120.0, edge="mm", minimum=1.0, maximum=10000.0, read_only=True, description="length along its axis")
    start: float = parameter(
        -10.0, edge="mm", minimum=-10000.0, maximum=10000.0, read_only=True, description="z of its beginning, in soft_base"
    )
    bend: float = parameter(
        0.0, edge="deg", minimum=-180.0, maximum=180.0, read_only=True, description="angle between its two ends"
    )
    plane: float = parameter(
        0.0,
        edge="deg",
        minimum=-360.0,
        maximum=360.0,
        read_only=True,
        description="direction into which it bends, about z from x",
    )


@dataclasses.dataclass(frozen=True)
class PageOptions:
    """Address, contents and look of the page."""

    host: str = parameter(
        "127.0.0.1",
        read_only=True,
        description="address to listen at; 0.0.0.0: every machine of the network can see and control the robot",
    )
    port: int = parameter(8080, minimum=1, maximum=65535, read_only=True, description="port; if it is in use, the next free one")
    rate: float = parameter(20.0, unit="Hz", minimum=1.0, maximum=60.0, read_only=True, description="updates of the page")
    window: float = parameter(20.0, unit="s", minimum=2.0, maximum=600.0, read_only=True, description="time span of the plots")
    look_back: float = parameter(
        120.0, unit="s", minimum=1.0, maximum=3600.0, read_only=True, description="time span that the page can show again"
    )
    graphics: str = parameter(
        AUTO,
        choices=(AUTO, *GRAPHICS),
        read_only=True,
        description="graphics at start; light: no reflections or shadows; auto: light on a machine without a graphics chip",
    )
    dark: bool = parameter(True, read_only=True, description="dark colours")
    lumen: LumenOptions = dataclasses.field(default_factory=LumenOptions)
