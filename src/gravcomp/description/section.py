"""Cross-sections that are not round, stations along a segment, and lumens off the axis."""

import dataclasses

from gravcomp.config import parameter


@dataclasses.dataclass(frozen=True)
class Section:
    """The outline of a segment, instead of its outer diameter; `width` lies along x."""

    shape: str = parameter(choices=("rectangle", "ellipse"), description="outline")
    width: float = parameter(edge="mm", minimum=0.05, maximum=1000.0, description="width, along x, at the base")
    height: float = parameter(edge="mm", minimum=0.05, maximum=1000.0, description="height, along y, at the base")
    tip_width: float | None = parameter(
        None, edge="mm", minimum=0.05, maximum=1000.0, description="width at the distal end; constant when not given"
    )
    tip_height: float | None = parameter(
        None, edge="mm", minimum=0.05, maximum=1000.0, description="height at the distal end; constant when not given"
    )


@dataclasses.dataclass(frozen=True)
class Station:
    """Sizes of a segment's section at a place along it; between two stations a size changes linearly."""

    z: float = parameter(edge="mm", minimum=0.0, maximum=5000.0, description="distance from the segment's base")
    outer_diameter: float | None = parameter(
        None, edge="mm", minimum=0.05, maximum=1000.0, description="outer diameter there; not with `section`"
    )
    lumen_diameter: float | None = parameter(
        None, edge="mm", minimum=0.01, maximum=999.0, description="diameter of the channel on the axis there"
    )
    width: float | None = parameter(None, edge="mm", minimum=0.05, maximum=1000.0, description="width of the `section` there")
    height: float | None = parameter(None, edge="mm", minimum=0.05, maximum=1000.0, description="height of the `section` there")


@dataclasses.dataclass(frozen=True)
class Lumen:
    """A round channel along the segment, anywhere in the section; parallel to the axis unless it follows the taper."""

    diameter: float = parameter(edge="mm", minimum=0.01, maximum=999.0, description="diameter")
    x: float = parameter(0.0, edge="mm", minimum=-500.0, maximum=500.0, description="x of its middle")
    y: float = parameter(0.0, edge="mm", minimum=-500.0, maximum=500.0, description="y of its middle")
    follow_taper: bool = parameter(
        False, description="place and diameter shrink with the section; those given are at the segment's base"
    )
