"""Cables: sliding tendons through the body, and the check that they run inside it."""

import dataclasses
import math
from collections.abc import Sequence

from gravcomp.config import parameter
from gravcomp.description.body import Segment


@dataclasses.dataclass(frozen=True)
class Cable:
    """A sliding tendon, fixed to the body at its last point and pulled at its first.

    It runs parallel to the axis at (radius cos angle, radius sin angle), or through `via_points` in soft_base.
    """

    name: str = parameter(description="name, unique in the robot")
    angle: float | None = parameter(None, edge="deg", minimum=-360.0, maximum=360.0, description="angle about z, from x")
    radius: float | None = parameter(None, edge="mm", minimum=0.0, maximum=500.0, description="pitch radius")
    segment: str | None = parameter(None, description="name of the segment at whose end the cable is fixed")
    start: float = parameter(0.0, edge="mm", minimum=0.0, maximum=50000.0, description="z where the cable enters the body")
    end: float | None = parameter(
        None, edge="mm", minimum=0.0, maximum=50000.0, description="z where the cable is fixed, instead of `segment`"
    )
    via_points: tuple[tuple[float, float, float], ...] | None = parameter(
        None, edge="mm", description="points that the cable slides through, first to last, instead of angle and radius"
    )
    axial_stiffness: float | None = parameter(
        None, unit="N", minimum=1.0, maximum=1e9, description="E A of the cable; inextensible when not given"
    )
    friction: float = parameter(0.0, minimum=0.0, maximum=2.0, description="capstan friction coefficient along the path")

    def __post_init__(self) -> None:
        if self.via_points is not None:
            if self.angle is not None or self.radius is not None or self.segment is not None or self.end is not None:
                raise ValueError(
                    f"cable '{self.name}' has via_points_mm and also angle_deg, radius_mm, segment or end_mm; give one form only"
                )
            if len(self.via_points) < 2:
                raise ValueError(f"cable '{self.name}' has {len(self.via_points)} via_points_mm; at least 2 are needed")
            return
        if self.angle is None or self.radius is None:
            raise ValueError(f"cable '{self.name}' needs angle_deg and radius_mm, or via_points_mm")
        if (self.segment is None) == (self.end is None):
            raise ValueError(f"cable '{self.name}' needs one of segment and end_mm")

    def points(self, end: float) -> tuple[tuple[float, float, float], ...]:
        """Return the points (m, soft_base) that the cable runs through: its via points, or both ends of a straight cable.

        `end` is the z where a straight cable is fixed; its points are returned as if its angle were 0.
        """
        if self.via_points is not None:
            return self.via_points
        assert self.radius is not None  # __post_init__
        return (self.radius, 0.0, self.start), (self.radius, 0.0, end)


def check_path(key: str, cable: Cable, end: float, segments: Sequence[Segment], length: float) -> None:
    """Raise ValueError, naming `key`, when the cable leaves the robot's length or the wall of a segment.

    `end` (m) is the z where the cable is fixed, `length` (m) that of the robot; without segments only the length is checked.
    """
    if end > length * (1 + 1e-9):
        raise ValueError(f"{key} ends at {end * 1e3:g} mm; allowed: up to the robot's length {length * 1e3:g} mm")
    straight = cable.via_points is None
    if straight and cable.start >= end:
        raise ValueError(f"{key}.start_mm is {cable.start * 1e3:g}; allowed: below its end at {end * 1e3:g}")
    z = 0.0
    for segment in segments:
        low, high = z, z + segment.full_length
        z = high
        for x, y, height in cable.points(end):
            through = straight and cable.start < high - 1e-9 and end > low + 1e-9
            if not through and not low <= height <= high:
                continue
            radius = math.hypot(x, y)
            inner, outer = segment.lumen_diameter / 2, segment.outer_diameter / 2
            if not inner <= radius <= outer:
                raise ValueError(
                    f"{key} runs {radius * 1e3:g} mm from the axis in segment '{segment.name}';"
                    f" allowed: within its wall, {inner * 1e3:g} to {outer * 1e3:g} mm"
                )
