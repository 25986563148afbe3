"""Spacer disks on a backbone: they guide the cables, which run straight from disk to disk."""

import dataclasses
import math

from gravcomp.config import parameter


@dataclasses.dataclass(frozen=True)
class Disks:
    """Rigid disks on a segment, the last one at its end. The segment itself is the backbone.

    `count` disks lie at equal distances; with `spacing` they lie at its multiples from the segment's base, and at its end. The
    base of the robot guides the cables like a disk.
    """

    count: int | None = parameter(
        None, minimum=1, maximum=200, description="number of disks on the segment, instead of spacing_mm"
    )
    outer_diameter: float = parameter(0.0, edge="mm", minimum=0.1, maximum=1000.0, description="outer diameter of a disk")
    thickness: float = parameter(1.0, edge="mm", minimum=0.0, maximum=500.0, description="thickness of a disk along the axis")
    mass: float | None = parameter(None, edge="g", minimum=0.0, maximum=1e5, description="mass of one disk, instead of density")
    density: float | None = parameter(
        None, unit="kg/m^3", minimum=0.0, maximum=30000.0, description="density of the disks; weightless when neither is given"
    )
    spacing: float | None = parameter(
        None, edge="mm", minimum=0.1, maximum=5000.0, description="distance from disk to disk, instead of count"
    )

    def __post_init__(self) -> None:
        if self.mass is not None and self.density is not None:
            raise ValueError("disks have mass_g and density; give one of them")
        if (self.count is None) == (self.spacing is None):
            found = "neither of" if self.count is None else "both"
            raise ValueError(f"disks have {found} count and spacing_mm; exactly one is needed")
        if self.outer_diameter == 0.0:
            raise ValueError("disks need outer_diameter_mm; allowed: 0.1 to 1000 mm")

    def mass_of(self, hole_area: float) -> float:
        """Return the mass (kg) of one disk, whose hole for the backbone has `hole_area` (m^2)."""
        if self.mass is not None:
            return self.mass
        return (self.density or 0.0) * self.thickness * max(math.pi / 4 * self.outer_diameter**2 - hole_area, 0.0)

    def heights(self, length: float) -> list[float]:
        """Return the distances (m) of the disks from the base of a segment of `length` (m)."""
        if self.spacing is None:
            assert self.count is not None  # __post_init__
            return [length * (index + 1) / self.count for index in range(self.count)]
        # A disk that would touch the one at the end is that one.
        last = length - max(self.thickness, 1e-6 * length)
        return [self.spacing * k for k in range(1, math.floor(last / self.spacing) + 1)] + [length]

    def check(self, length: float, backbone_width: float) -> None:
        """Raise ValueError where the disks do not fit on a segment of `length` (m) that is `backbone_width` (m) wide."""
        if self.outer_diameter <= backbone_width:
            raise ValueError(
                f"disks.outer_diameter_mm is {self.outer_diameter * 1e3:g}; allowed: above the width of the backbone,"
                f" {1e3 * backbone_width:g} mm"
            )
        if self.spacing is not None and self.spacing > length * (1 + 1e-9):
            raise ValueError(
                f"disks.spacing_mm is {self.spacing * 1e3:g}; allowed: up to the segment's length, {length * 1e3:g} mm"
            )
        if self.spacing is not None and self.spacing < self.thickness:
            raise ValueError(
                f"disks.spacing_mm is {self.spacing * 1e3:g}; allowed: at least their thickness, {self.thickness * 1e3:g} mm"
            )
        if self.count is not None and self.thickness * self.count > length:
            raise ValueError(
                f"disks.count x disks.thickness_mm is {self.thickness * self.count * 1e3:g};"
                f" allowed: up to the segment's length, {length * 1e3:g} mm"
            )
