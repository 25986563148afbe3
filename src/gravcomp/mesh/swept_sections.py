"""Whether the section of a body from a file can be swept along its axis, and its curves at every height.

A body is swept where every section has one outline and the same one lumen or none, whose rays from their middles meet them once,
and where the section changes gradually, also at its ends; a tip may be rounded (`rounded_tip`). Sharp edges along the body, up to
four, get nodes of their own.
"""

import dataclasses
import functools
import math
from collections.abc import Sequence

import numpy as np

from gravcomp.description import Material, MeshBody, SectionMoments
from gravcomp.description.section_moments import boundary_moments
from gravcomp.mesh.layered_cells import halved
from gravcomp.mesh.measured_outline import MeasuredOutline
from gravcomp.mesh.mesh import MeshError
from gravcomp.mesh.rounded_tip import layers_in_rounding, stretched
from gravcomp.mesh_files.contours import enclosed_area, section_contours
from gravcomp.mesh_files.level_cut import level_cut
from gravcomp.mesh_files.placing import PlacedBody

_SAMPLES = 65
# At the ends a section is taken a part of the length inside the body: the first of these from which on the section is whole.
_INSIDE = (1e-9, 1e-4, 1e-3, 2e-3, 5e-3, 1e-2)
# How far inside the next ones are (of the length), and by how much the areas of whole sections differ from even growth.
_FARTHER, _WHOLE = 5e-3, 1e-3
# From one sample to the next the area changes by this factor at most.
_STEP = 1.6
# Corners of two sections belong together when they are this near (rad).
_SAME_CORNER = math.radians(25.0)


@dataclasses.dataclass(frozen=True, eq=False)
class SweptSections:
    """The sections of a body along its axis, as the one piece (`description.Piece`) that layers of elements divide.

    placed: the body; material; corners: of every curve, from the innermost out, the polar angles (k,) in rad of its sharp edges
    at the base; slots: of every curve the polar angles (4,) there of the nodes at the corners of a square, None without edges;
    ends: the arc lengths (m) next to base and tip up to which there are whole sections, which stand for those beyond; rounding:
    of the tip, as from `layers_in_rounding`; start: as that of a piece.
    """

    placed: PlacedBody
    material: Material
    corners: tuple[np.ndarray, ...]
    slots: tuple[np.ndarray | None, ...]
    ends: tuple[float, float]
    rounding: tuple[float, ...] = ()
    start: float = 0.0

    @property
    def length(self) -> float:
        """Length along the axis (m)."""
        return self.placed.length

    @property
    def marks(self) -> tuple[float, ...]:
        """Arc lengths (m) at which layers must end: in a rounding."""
        return self.rounding[:-1]

    @property
    def in_quarters(self) -> bool:
        """Whether elements around come in multiples of 4: solid sections and those with sharp edges need that."""
        return len(self.corners) == 1 or self.slots[0] is not None

    def moments(self, s: float) -> SectionMoments:
        """Return area, centroid and second moments of the section at the arc length s (m); in a rounding, of that below it."""
        s = min(s, self.rounding[0]) if self.rounding else s
        return boundary_moments(level_cut(self.placed.straight_surface, self._within(s)))

    def curves(self, s: float) -> list[MeasuredOutline]:
        """Return the curves at the arc length s (m), from the innermost out, with slots where they have sharp edges.

        Raises MeshError where they cannot be swept.
        """
        found = _curves(self.placed, self._within(stretched(s, self.rounding, self.length)))
        if len(found) != len(self.corners):
            raise MeshError(
                f"its section at {1e3 * s:.3g} mm has {len(found) - 1} lumens, not {len(self.corners) - 1} as at the base"
            )
        result = []
        for curve, corners, slots in zip(found, self.corners, self.slots):
            moved = _moved(curve.corners, corners, s)
            if slots is not None:
                slots = slots.copy()
                for corner, by in zip(corners, moved):
                    slots[np.argmin(np.abs(_wrapped(slots - corner)))] += by
            result.append(curve.with_slots(slots))
        return result

    def _within(self, s: float) -> float:
        return float(np.clip(s, *self.ends))


def swept_sections(body: MeshBody) -> SweptSections:
    """Return the sections of a body from a file. Raises MeshError, with the reason, where they cannot be swept."""
    found = _sections(body.placed())
    if isinstance(found, str):
        raise MeshError(found)
    return dataclasses.replace(found, material=body.material)


@functools.lru_cache(maxsize=4)
def _sections(placed: PlacedBody) -> SweptSections | str:
    """The sections, of a default material; or why they cannot be swept."""
    try:
        return _checked(placed)
    except MeshError as error:
        return str(error)


def _checked(placed: PlacedBody) -> SweptSections:
    """The sections, of a default material. Raises MeshError."""
    low = _whole_section(placed, tip=False)
    rounding = layers_in_rounding(lambda s: _area(placed, s), placed.length)
    high = rounding[-1] if rounding else _whole_section(placed, tip=True)
    first = _curves(placed, low)
    corners = tuple(curve.corners for curve in first)
    if max(map(len, corners)) > 4:
        raise MeshError(f"its section has {max(map(len, corners))} sharp edges; up to 4 are swept")
    found = SweptSections(placed, Material(), corners, _slots(first), (low, high), rounding)
    before = None
    for height in np.linspace(low, rounding[0] if rounding else high, _SAMPLES):
        area = found.moments(height).area
        if before is not None and not before / _STEP < area < before * _STEP:
            raise MeshError(f"its section changes in a step at {1e3 * height:.3g} mm")
        before = area
        found.curves(height)
    for height in halved(np.array([*found.marks, placed.length])) if rounding else ():
        found.curves(height)
    return found


def _whole_section(placed: PlacedBody, tip: bool) -> float:
    """The arc length (m) next to an end of the body where the section is as large as those a little farther inside let expect.

    The end of a body that is bent at rest, and the edge of a filleted one, are not exactly across the axis.
    """
    for inside in _INSIDE:
        parts = inside + _FARTHER * np.arange(3)
        here, one, other = (_area(placed, part * placed.length) for part in (1.0 - parts if tip else parts))
        if abs(here - (2.0 * one - other)) < _WHOLE * one:
            break
    return (1.0 - inside if tip else inside) * placed.length


def _area(placed: PlacedBody, height: float) -> float:
    return boundary_moments(level_cut(placed.straight_surface, height)).area


@functools.lru_cache(maxsize=512)
def _curves(placed: PlacedBody, height: float) -> tuple[MeasuredOutline, ...]:
    """The curves at a height (m), from the innermost out. Raises MeshError where they are not an outline with a lumen or none."""
    where = f"at {1e3 * height:.3g} mm"
    contours = section_contours(placed.straight_surface, height)
    lumens = [contour[::-1] for contour in contours if enclosed_area(contour) < 0.0]
    outlines = [contour for contour in contours if enclosed_area(contour) > 0.0]
    if len(outlines) != 1 or len(lumens) > 1:
        raise MeshError(f"its section {where} has {len(outlines)} outlines and {len(lumens)} lumens; one and up to one are swept")
    try:
        return tuple(MeasuredOutline(contour) for contour in (*lumens, *outlines))
    except ValueError as error:
        raise MeshError(f"a curve of its section {where} is not swept: {error}") from error


def _slots(curves: Sequence[MeasuredOutline]) -> tuple[np.ndarray | None, ...]:
    """The polar angles (4,) in rad of every curve's corners of a square, in one order; None where no curve has sharp edges."""
    cornered = [curve for curve in curves if len(curve.corners)]
    if not cornered:
        return (None,) * len(curves)
    leading = cornered[-1].four_slots()
    leading = _ascending(np.roll(leading, -int(np.argmin(np.abs(_wrapped(leading - math.pi / 4))))))
    even = np.arange(4) * math.pi / 2
    smooth = 0.5 * (leading + even + (leading - even).mean())  # half way from the other curve's to evenly spaced ones
    result = []
    for curve in curves:
        slots = smooth
        if len(curve.corners):
            ways = [np.roll(curve.four_slots(), -turn) for turn in range(4)]
            slots = _ascending(min(ways, key=lambda way: float(np.abs(_wrapped(way - leading)).sum())))
        result.append(slots)
    return tuple(result)


def _ascending(angles: np.ndarray) -> np.ndarray:
    """The angles (4,) in rad, each but the first one up to a turn beyond the first."""
    return angles[0] + np.mod(angles - angles[0], 2 * math.pi)


def _moved(found: np.ndarray, known: np.ndarray, s: float) -> np.ndarray:
    """By how much (k,) in rad the corners of a section are off those at the base. Raises MeshError where they are others."""
    for turn in range(max(1, len(known))) if len(found) == len(known) else ():
        by = _wrapped(np.roll(found, -turn) - known)
        if (np.abs(by) < _SAME_CORNER).all():
            return by
    raise MeshError(
        f"its section at {1e3 * s:.3g} mm has {len(found)} sharp edges in other places than the {len(known)} at the base"
    )


def _wrapped(angle: np.ndarray) -> np.ndarray:
    return np.mod(angle + math.pi, 2 * math.pi) - math.pi
