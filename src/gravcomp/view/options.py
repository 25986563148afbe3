"""How the page is served and looks."""

import dataclasses

from gravcomp.config import parameter
from gravcomp.view.graphics import AUTO, GRAPHICS


@dataclasses.dataclass(frozen=True)
class LumenOptions:
    """The wall of a channel that the robot reaches through, drawn only."""

    diameter: float = parameter(
        0.0, edge="mm", minimum=0.0, maximum=1000.0, read_only=True, description="inner diameter; 0: none"
    )
    length: float = parameter(120.0, edge="mm", minimum=1.0, maximum=10000.0, read_only=True, description="along its axis")
    start: float = parameter(
        -10.0, edge="mm", minimum=-10000.0, maximum=10000.0, read_only=True, description="z where it begins, in soft_base"
    )
    bend: float = parameter(
        0.0, edge="deg", minimum=-180.0, maximum=180.0, read_only=True, description="from one end to the other"
    )
    plane: float = parameter(0.0, edge="deg", minimum=-360.0, maximum=360.0, read_only=True, description="into which it bends")


@dataclasses.dataclass(frozen=True)
class PageOptions:
    """How the page is served and looks."""

    host: str = parameter(
        "127.0.0.1",
        read_only=True,
        description="address to listen at; 0.0.0.0 lets every machine of the network see and steer the robot",
    )
    port: int = parameter(8080, minimum=1, maximum=65535, read_only=True, description="port; the next free one when it is taken")
    rate: float = parameter(20.0, unit="Hz", minimum=1.0, maximum=60.0, read_only=True, description="of the page")
    window: float = parameter(20.0, unit="s", minimum=2.0, maximum=600.0, read_only=True, description="of the plots")
    look_back: float = parameter(
        120.0, unit="s", minimum=1.0, maximum=3600.0, read_only=True, description="how far back the page can be turned"
    )
    graphics: str = parameter(
        AUTO, choices=(AUTO, *GRAPHICS), read_only=True,
        description="at the start; light: without reflections and shadows, for machines whose processor draws; auto: light where this one has no graphics chip")  # fmt: skip
    dark: bool = parameter(True, read_only=True, description="dark colours")
    lumen: LumenOptions = dataclasses.field(default_factory=LumenOptions)
