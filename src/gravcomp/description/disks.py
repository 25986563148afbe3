"""Spacer disks on a backbone: they guide the cables, which run straight from disk to disk."""

import dataclasses
import math

from gravcomp.config import parameter


@dataclasses.dataclass(frozen=True)
class Disks:
    """Rigid disks at equal distances on a segment, the last one at its end. The segment itself is the backbone.

    The base of the robot guides the cables like a disk.
    """

    count: int = parameter(minimum=1, maximum=200, description="number of disks on the segment")
    outer_diameter: float = parameter(edge="mm", minimum=0.1, maximum=1000.0, description="outer diameter of a disk")
    thickness: float = parameter(1.0, edge="mm", minimum=0.0, maximum=500.0, description="thickness of a disk along the axis")
    mass: float | None = parameter(None, edge="g", minimum=0.0, maximum=1e5, description="mass of one disk, instead of density")
    density: float | None = parameter(
        None, unit="kg/m^3", minimum=0.0, maximum=30000.0, description="density of the disks; weightless when neither is given"
    )

    def __post_init__(self) -> None:
        if self.mass is not None and self.density is not None:
            raise ValueError("disks have mass_g and density; give one of them")

    def mass_of(self, hole_area: float) -> float:
        """Return the mass (kg) of one disk, whose hole for the backbone has `hole_area` (m^2)."""
        if self.mass is not None:
            return self.mass
        return (self.density or 0.0) * self.thickness * max(math.pi / 4 * self.outer_diameter**2 - hole_area, 0.0)

    def heights(self, length: float) -> list[float]:
        """Return the distances (m) of the disks from the segment's base."""
        return [length * (index + 1) / self.count for index in range(self.count)]
