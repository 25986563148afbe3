"""Cross-sections that are not round, and lumens off the axis."""

import dataclasses

from gravcomp.config import parameter


@dataclasses.dataclass(frozen=True)
class Section:
    """The outline of a segment, instead of its outer diameter; `width` lies along x."""

    shape: str = parameter(choices=("rectangle", "ellipse"), description="outline")
    width: float = parameter(edge="mm", minimum=0.05, maximum=1000.0, description="width, along x")
    height: float = parameter(edge="mm", minimum=0.05, maximum=1000.0, description="height, along y")
    tip_width: float | None = parameter(
        None, edge="mm", minimum=0.05, maximum=1000.0, description="width at the distal end; `width` when not given"
    )
    tip_height: float | None = parameter(
        None, edge="mm", minimum=0.05, maximum=1000.0, description="height at the distal end; `height` when not given"
    )


@dataclasses.dataclass(frozen=True)
class Lumen:
    """A round channel parallel to the axis, anywhere in the section."""

    diameter: float = parameter(edge="mm", minimum=0.01, maximum=999.0, description="diameter")
    x: float = parameter(0.0, edge="mm", minimum=-500.0, maximum=500.0, description="x of its middle")
    y: float = parameter(0.0, edge="mm", minimum=-500.0, maximum=500.0, description="y of its middle")
