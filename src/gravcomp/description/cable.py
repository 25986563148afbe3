"""Cables: sliding tendons through the body."""

import dataclasses
import math

import numpy as np

from gravcomp.config import parameter
from gravcomp.description.cable_line import CableLine


@dataclasses.dataclass(frozen=True)
class Cable(CableLine):
    """A sliding tendon, fixed to the body at its last point and pulled at its first.

    It runs along the axis at (radius cos angle, radius sin angle) of every section, or through `via_points`: their x and y
    lie in the section, their z is the arc length along the axis, which for a robot that is straight at rest is z of soft_base.
    """

    name: str = parameter(description="name, unique in the robot")
    angle: float | None = parameter(None, edge="deg", minimum=-360.0, maximum=360.0, description="angle about z, from x")
    radius: float | None = parameter(None, edge="mm", minimum=0.0, maximum=500.0, description="pitch radius")
    tip_radius: float | None = parameter(
        None, edge="mm", minimum=0.0, maximum=500.0, description="pitch radius at the cable's end; as at its start when not given"
    )
    segment: str | None = parameter(None, description="name of the segment at whose end the cable is fixed")
    start: float = parameter(0.0, edge="mm", minimum=0.0, maximum=50000.0, description="z where the cable enters the body")
    end: float | None = parameter(
        None, edge="mm", minimum=0.0, maximum=50000.0, description="z where the cable is fixed, instead of `segment`"
    )
    via_points: tuple[tuple[float, float, float], ...] | None = parameter(
        None, edge="mm", description="points that the cable slides through, first to last, instead of angle and radius"
    )
    follow_taper: bool = parameter(
        False, description="the channel comes nearer to the axis as the section shrinks; `radius` is that at its start"
    )

    def __post_init__(self) -> None:
        try:
            super().__post_init__()
        except ValueError as error:
            raise ValueError(f"cable '{self.name}': {error}") from error
        if self.via_points is not None:
            if (
                self.angle is not None
                or self.radius is not None
                or self.tip_radius is not None
                or self.follow_taper
                or self.start
                or self.segment is not None
                or self.end is not None
            ):
                raise ValueError(
                    f"cable '{self.name}' has via_points_mm and also angle_deg, radius_mm, tip_radius_mm, follow_taper,"
                    " start_mm, segment or end_mm; give one form only"
                )
            if len(self.via_points) < 2:
                raise ValueError(f"cable '{self.name}' has {len(self.via_points)} via_points_mm; at least 2 are needed")
            first, last = self.via_points[0][2], self.via_points[-1][2]
            if last <= first:
                raise ValueError(
                    f"cable '{self.name}': via_points_mm begin at z = {first * 1e3:g} and end at {last * 1e3:g};"
                    " they go from where the cable is pulled to its fixed end, which is farther from the base"
                )
            return
        if self.follow_taper and self.tip_radius is not None:
            raise ValueError(f"cable '{self.name}' has follow_taper and also tip_radius_mm; give one of them")
        if self.angle is None or self.radius is None:
            raise ValueError(f"cable '{self.name}' needs angle_deg and radius_mm, or via_points_mm")
        if (self.segment is None) == (self.end is None):
            raise ValueError(f"cable '{self.name}' needs one of segment and end_mm")

    def place(self, s: float, end: float) -> tuple[float, float]:
        """Return (x, y) in m where the cable crosses the section at the arc length s (m), without the taper that it may follow.

        `end` (m) is the arc length where the cable is fixed. `Robot.cable_place` includes the taper.
        """
        if self.via_points is not None:
            heights, x, y = [v[2] for v in self.via_points], [v[0] for v in self.via_points], [v[1] for v in self.via_points]
            return float(np.interp(s, heights, x)), float(np.interp(s, heights, y))
        assert self.radius is not None and self.angle is not None  # __post_init__
        tip = self.radius if self.tip_radius is None else self.tip_radius
        radius = self.radius + (tip - self.radius) * min(max((s - self.start) / (end - self.start), 0.0), 1.0)
        return radius * math.cos(self.angle), radius * math.sin(self.angle)
