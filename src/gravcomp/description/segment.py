"""A segment of the body: a tube or a solid bar, constant or tapered, straight or bent at rest, with or without disks."""

import dataclasses
import itertools
import math
from collections.abc import Sequence

from gravcomp.config import parameter
from gravcomp.description.blended_outline import BlendedOutline
from gravcomp.description.body import Cap, Material
from gravcomp.description.disks import Disks
from gravcomp.description.outline import Outline, encloses
from gravcomp.description.profile import check_stations, size_at
from gravcomp.description.rest_shape import RestShape
from gravcomp.description.section import Lumen, Section, Station
from gravcomp.description.spring import Spring

# A wall thinner than this part of the section's half width cannot be meshed.
_THINNEST = 0.02


@dataclasses.dataclass(frozen=True)
class Segment:
    """A slender body whose section, round unless `section` is given, changes linearly from base to tip, or between stations.

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
    lumens: tuple[Lumen, ...] = parameter((), description="channels off the axis, in addition to lumen_diameter")
    rest: RestShape | None = parameter(None, description="shape at rest; straight when not given")
    disks: Disks | None = parameter(None, description="spacer disks, which guide the cables")
    transition: float | None = parameter(
        None, edge="mm", minimum=0.01, maximum=5000.0,
        description="length at its base over which its section develops from that of the segment before, where they differ;"
        " twice as long as the outline moves when not given",
    )  # fmt: skip
    stations: tuple[Station, ...] = parameter((), description="sizes at places along the segment; linear between")
    spring: Spring | None = parameter(
        None, description="the segment is a helical spring of this wire, with outer_diameter; its material is the wire's"
    )

    def __post_init__(self) -> None:
        self._check_outline()
        if self.spring is not None:
            self._check_spring(self.spring)
        parts = (0.0, *self.breaks, 1.0)
        for part in parts:
            self._check_lumen(part)
        # Lumens that move towards each other may be nearest between two stations.
        for part in sorted({*parts, *((a + b) / 2 for a, b in itertools.pairwise(parts))}):
            require_room(self.outline(part), self.lumen_outlines(part))
        half = max(max(o.half_width, o.half_height) for o in map(self.outline, parts))
        if self.rest is not None and self.rest.bend_angle:
            radius = self.length / abs(self.rest.bend_angle)
            if radius <= half:
                raise ValueError(
                    f"rest.bend_angle_deg bends the axis to a radius of {radius * 1e3:.3g} mm;"
                    f" allowed: more than half the width of the section, {half * 1e3:g} mm"
                )
        if self.disks is not None:
            self.disks.check(self.length, self.outer_diameter if self.spring else 2 * half)

    @property
    def full_length(self) -> float:
        """Length with the cap (m)."""
        return self.length + (self.cap.length if self.cap else 0.0)

    @property
    def breaks(self) -> tuple[float, ...]:
        """Parts of its length, its ends not among them, between which the section changes linearly."""
        return tuple(s.z / self.length for s in self.stations if 1e-9 < s.z / self.length < 1.0 - 1e-9)

    @property
    def body_material(self) -> Material:
        """The material of its sections: that of the tube in place of a spring."""
        return self.material if self.spring is None else self.spring.tube_material(self.material, self.outer_diameter)

    def outline(self, part: float) -> Outline:
        """Return the outline of the section at `part` of the segment's length, 0 at its base to 1 at its tip.

        That of a spring is the outline of the tube in its place.
        """
        if self.spring is not None:
            return Outline.circle(self.spring.diameters(self.outer_diameter, self.material.poissons_ratio)[0])
        if self.section is None:
            return Outline.circle(self._size("outer_diameter", self.outer_diameter, self.tip_outer_diameter, part))
        s = self.section
        width, height = self._size("width", s.width, s.tip_width, part), self._size("height", s.height, s.tip_height, part)
        return Outline(s.shape, width / 2, height / 2)

    @property
    def coils(self) -> tuple[Outline, Outline] | None:
        """Outer and inner outline of a spring; None for any other segment."""
        if self.spring is None:
            return None
        return Outline.circle(self.outer_diameter), Outline.circle(self.outer_diameter - 2 * self.spring.wire_diameter)

    def hole_of_disks(self, part: float) -> Outline:
        """Return the outline of the backbone where a disk holds it, at `part` of the length: of a spring its own."""
        return Outline.circle(self.outer_diameter) if self.spring is not None else self.outline(part)

    def lumen_outlines(self, part: float) -> tuple[Outline, ...]:
        """Return the outlines of the lumens there, the one on the axis first; none in a solid segment."""
        if self.spring is not None:
            return (Outline.circle(self.spring.diameters(self.outer_diameter, self.material.poissons_ratio)[1]),)
        found = []
        diameter = self._size("lumen_diameter", self.lumen_diameter, self.tip_lumen_diameter, part)
        if diameter:
            found.append(Outline.circle(diameter))
        across, up = self.taper(part)
        for lumen in self.lumens:
            if lumen.follow_taper:
                found.append(Outline.circle(lumen.diameter * (across + up) / 2, lumen.x * across, lumen.y * up))
            else:
                found.append(Outline.circle(lumen.diameter, lumen.x, lumen.y))
        return tuple(found)

    def taper(self, part: float) -> tuple[float, float]:
        """Return width and height of the outline there, relative to those at the segment's base."""
        base, here = self.outline(0.0), self.outline(part)
        return here.half_width / base.half_width, here.half_height / base.half_height

    def _size(self, key: str, base: float, tip: float | None, part: float) -> float:
        return size_at(key, base, tip, self.stations, self.length, part)

    def _check_outline(self) -> None:
        given = self.outer_diameter > 0.0 or any(s.z == 0.0 and s.outer_diameter is not None for s in self.stations)
        if (self.section is None) != given:
            found = "neither of" if self.section is None else "both"
            joined = "and" if self.section is None else "and also"
            raise ValueError(f"segment '{self.name}' has {found} outer_diameter_mm {joined} section; exactly one is needed")
        if self.section is not None and self.tip_outer_diameter is not None:
            raise ValueError("tip_outer_diameter_mm belongs to a round segment; give section.tip_width_mm and tip_height_mm")
        if self.tip_lumen_diameter is not None and not self.lumen_diameter:
            raise ValueError("tip_lumen_diameter_mm is given without lumen_diameter_mm")
        s = self.section
        ends = {
            "outer_diameter": (self.outer_diameter > 0.0, self.tip_outer_diameter is not None),
            "lumen_diameter": (self.lumen_diameter > 0.0, self.tip_lumen_diameter is not None),
            "width": (s is not None, s is not None and s.tip_width is not None),
            "height": (s is not None, s is not None and s.tip_height is not None),
        }
        check_stations(self.stations, self.length, s is None, ends)

    def _check_spring(self, spring: Spring) -> None:
        """Raise ValueError for what a spring does not have, and for a spring that cannot be wound."""
        refused = {
            "section": self.section is not None,
            "lumen_diameter_mm": self.lumen_diameter > 0.0,
            "tip_outer_diameter_mm": self.tip_outer_diameter is not None,
            "lumens": bool(self.lumens),
            "stations": bool(self.stations),
            "material.fibres": self.material.fibres is not None,
        }
        for key, given in refused.items():
            if given:
                raise ValueError(f"segment '{self.name}' has spring and also {key}; give one of them")
        spring.check(self.outer_diameter)

    def _check_lumen(self, part: float) -> None:
        """Raise ValueError where the channel on the axis leaves no wall, naming the keys that say so."""
        if self.section is not None or self.spring is not None:
            return
        inner = self._size("lumen_diameter", self.lumen_diameter, self.tip_lumen_diameter, part)
        outer = 2 * self.outline(part).half_width
        if inner < 0.98 * outer:
            return
        end = "tip_" if part == 1.0 else ""
        name = end if self.tip_lumen_diameter is not None else ""
        of = end if self.tip_outer_diameter is not None else ""
        where = f" at {part * self.length * 1e3:g} mm" if self.stations else ""
        raise ValueError(
            f"{name}lumen_diameter_mm is {inner * 1e3:g}{where}; allowed: below 0.98 x {of}outer_diameter_mm = {outer * 980:g}"
        )


def require_room(outline: Outline | BlendedOutline, lumens: Sequence[Outline]) -> None:
    """Raise ValueError where a lumen leaves the outline or touches another."""
    thinnest = _THINNEST * min(outline.half_width, outline.half_height)
    for lumen in lumens:
        if not encloses(outline, lumen, thinnest):
            raise ValueError(
                f"a lumen ({lumen}) does not lie inside the outline ({outline});"
                f" a wall of at least {thinnest * 1e3:.2g} mm is needed"
            )
    for one, other in itertools.combinations(lumens, 2):
        gap = math.hypot(one.x - other.x, one.y - other.y) - one.half_width - other.half_width
        if gap < thinnest:
            raise ValueError(
                f"the lumens ({one}) and ({other}) touch or overlap; a wall of at least {thinnest * 1e3:.2g} mm is needed"
            )
