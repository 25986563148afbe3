"""A segment of the body: a tube or a solid bar, constant or tapered, straight or bent at rest, with or without disks."""

import dataclasses
import itertools
import math

import numpy as np

from gravcomp.config import parameter
from gravcomp.description.body import Cap, Material
from gravcomp.description.disks import Disks
from gravcomp.description.outline import Outline
from gravcomp.description.rest_shape import RestShape
from gravcomp.description.section import Lumen, Section

# A wall thinner than this part of the section's half width cannot be meshed.
_THINNEST = 0.02


@dataclasses.dataclass(frozen=True)
class Segment:
    """A slender body whose section changes linearly from its base to its tip: round unless `section` is given.

    Without lumen it is solid. With `disks` it is a backbone, and the disks guide the cables.
    """

    name: str = parameter(description="name, unique in the robot")
    length: float = parameter(edge="mm", minimum=1.0, maximum=5000.0, description="length at rest, without its cap")
    outer_diameter: float = parameter(
        0.0, edge="mm", minimum=0.05, maximum=1000.0, description="outer diameter; not with `section`"
    )
    lumen_diameter: float = parameter(
        0.0, edge="mm", minimum=0.0, maximum=999.0, description="diameter of the working channel on the axis; 0: solid"
    )
    material: Material = parameter(default_factory=Material, description="material of the tube")
    cap: Cap | None = parameter(None, description="cap at the distal end")
    section: Section | None = parameter(None, description="outline that is not round")
    tip_outer_diameter: float | None = parameter(
        None, edge="mm", minimum=0.05, maximum=1000.0, description="outer diameter at the distal end; constant when not given"
    )
    tip_lumen_diameter: float | None = parameter(
        None, edge="mm", minimum=0.01, maximum=999.0, description="lumen diameter at the distal end; constant when not given"
    )
    lumens: tuple[Lumen, ...] = parameter((), description="channels off the axis, instead of lumen_diameter")
    rest: RestShape | None = parameter(None, description="shape at rest; straight when not given")
    disks: Disks | None = parameter(None, description="spacer disks, which guide the cables")

    def __post_init__(self) -> None:
        self._check_outline()
        self._check_lumens()
        if self.rest is not None and self.rest.bend_angle:
            radius = self.length / abs(self.rest.bend_angle)
            half = max(max(o.half_width, o.half_height) for o in (self.outline(0.0), self.outline(1.0)))
            if radius <= half:
                raise ValueError(
                    f"rest.bend_angle_deg bends the axis to a radius of {radius * 1e3:.3g} mm;"
                    f" allowed: more than half the width of the section, {half * 1e3:g} mm"
                )
        if self.disks is not None:
            hole = max(max(o.half_width, o.half_height) for o in (self.outline(0.0), self.outline(1.0)))
            if self.disks.outer_diameter <= 2 * hole:
                raise ValueError(
                    f"disks.outer_diameter_mm is {self.disks.outer_diameter * 1e3:g}; allowed: above the width of the backbone,"
                    f" {2e3 * hole:g} mm"
                )
            if self.disks.thickness * self.disks.count > self.length:
                raise ValueError(
                    f"disks.count x disks.thickness_mm is {self.disks.thickness * self.disks.count * 1e3:g};"
                    f" allowed: up to the segment's length, {self.length * 1e3:g} mm"
                )

    @property
    def plain(self) -> bool:
        """Whether it is round, of constant section, straight at rest, without lumens off the axis and without disks."""
        tapered = self.tip_outer_diameter is not None or self.tip_lumen_diameter is not None
        return self.section is None and not tapered and not self.lumens and self.rest is None and self.disks is None

    @property
    def full_length(self) -> float:
        """Length with the cap (m)."""
        return self.length + (self.cap.length if self.cap else 0.0)

    def outline(self, part: float) -> Outline:
        """Return the outline of the section at `part` of the segment's length, 0 at its base to 1 at its tip."""
        if self.section is None:
            return Outline.circle(_between(self.outer_diameter, self.tip_outer_diameter, part))
        s = self.section
        return Outline(s.shape, _between(s.width, s.tip_width, part) / 2, _between(s.height, s.tip_height, part) / 2)

    def lumen_outlines(self, part: float) -> tuple[Outline, ...]:
        """Return the outlines of the lumens there; none in a solid segment."""
        if self.lumen_diameter:
            return (Outline.circle(_between(self.lumen_diameter, self.tip_lumen_diameter, part)),)
        return tuple(Outline.circle(lumen.diameter, lumen.x, lumen.y) for lumen in self.lumens)

    def area(self, part: float) -> float:
        """Return the area (m^2) of the section there."""
        return self.outline(part).area - sum(lumen.area for lumen in self.lumen_outlines(part))

    def contains(self, x: float, y: float, part: float) -> bool:
        """Return whether the point (x, y) of the section there lies in the body, on its surface included."""
        inside = self.outline(part).gauge(x, y) <= 1.0 + 1e-9
        return inside and all(lumen.gauge(x, y) >= 1.0 - 1e-9 for lumen in self.lumen_outlines(part))

    def _check_outline(self) -> None:
        if (self.section is None) == (self.outer_diameter == 0.0):
            found = "neither of" if self.section is None else "both"
            joined = "and" if self.section is None else "and also"
            raise ValueError(f"segment '{self.name}' has {found} outer_diameter_mm {joined} section; exactly one is needed")
        if self.section is not None and self.tip_outer_diameter is not None:
            raise ValueError("tip_outer_diameter_mm belongs to a round segment; give section.tip_width_mm and tip_height_mm")
        if self.lumen_diameter and self.lumens:
            raise ValueError("lumen_diameter_mm and lumens are both given; give one of them")
        if self.tip_lumen_diameter is not None and not self.lumen_diameter:
            raise ValueError("tip_lumen_diameter_mm is given without lumen_diameter_mm")

    def _check_lumens(self) -> None:
        if self.section is None:
            for part, end in ((0.0, ""), (1.0, "tip_")):
                inner = _between(self.lumen_diameter, self.tip_lumen_diameter, part)
                outer = _between(self.outer_diameter, self.tip_outer_diameter, part)
                if inner >= 0.98 * outer:
                    name = end if self.tip_lumen_diameter is not None else ""
                    of = end if self.tip_outer_diameter is not None else ""
                    raise ValueError(
                        f"{name}lumen_diameter_mm is {inner * 1e3:g}; allowed: below 0.98 x"
                        f" {of}outer_diameter_mm = {outer * 980:g}"
                    )
        for part in (0.0, 1.0):
            outline, lumens = self.outline(part), self.lumen_outlines(part)
            for lumen in lumens:
                thinnest = _THINNEST * min(outline.half_width, outline.half_height)
                if not _within(outline, lumen, thinnest):
                    raise ValueError(
                        f"a lumen ({lumen}) does not lie inside the outline ({outline});"
                        f" a wall of at least {thinnest * 1e3:.2g} mm is needed"
                    )
            for one, other in itertools.combinations(lumens, 2):
                gap = math.hypot(one.x - other.x, one.y - other.y) - one.half_width - other.half_width
                if gap < _THINNEST * min(outline.half_width, outline.half_height):
                    raise ValueError(f"the lumens ({one}) and ({other}) touch; a wall between them is needed")


def check_joint(before: Segment, after: Segment) -> None:
    """Raise ValueError when two neighbouring segments do not touch, so that nothing holds the second one."""
    one, other = before.outline(1.0), after.outline(0.0)
    for holed, lumens, outline in ((before, before.lumen_outlines(1.0), other), (after, after.lumen_outlines(0.0), one)):
        for lumen in lumens:
            if _within(lumen, outline, -1e-9):
                raise ValueError(
                    f"segments '{before.name}' and '{after.name}' do not touch: one fits into the other's lumen,"
                    f" {lumen} in '{holed.name}'"
                )


def _within(outer: Outline, inner: Outline, gap: float) -> bool:
    """Whether `inner` lies inside `outer` with at least `gap` (m) between them."""
    points = inner.boundary(np.linspace(0.0, 2 * math.pi, 48, endpoint=False))
    middle = (outer.x, outer.y)
    for x, y in points:
        reach = math.hypot(x - middle[0], y - middle[1])
        if outer.gauge(x, y) * (1.0 + (gap / reach if reach > 0 else 0.0)) > 1.0 + 1e-9:
            return False
    return True


def _between(base: float, tip: float | None, part: float) -> float:
    return base if tip is None else base + part * (tip - base)
