"""The check that a cable runs inside the body, or through the disks."""

import math
from collections.abc import Sequence

from gravcomp.description.cable import Cable
from gravcomp.description.segment import Segment


def check_path(key: str, cable: Cable, end: float, segments: Sequence[Segment], length: float) -> None:
    """Raise ValueError, naming `key`, when the cable leaves the robot's length, the wall of a segment or its disks.

    `end` (m) is the arc length where the cable is fixed, `length` (m) that of the robot; without segments only the length is
    checked.
    """
    if end > length * (1 + 1e-9):
        raise ValueError(f"{key} ends at {end * 1e3:g} mm; allowed: up to the robot's length {length * 1e3:g} mm")
    straight = cable.via_points is None
    if straight and cable.start >= end:
        raise ValueError(f"{key}.start_mm is {cable.start * 1e3:g}; allowed: below its end at {end * 1e3:g}")
    base = 0.0
    for segment in segments:
        for x, y, s in _points(cable, end, base, segment):
            if segment.disks is None:
                _check_wall(key, segment, x, y, (s - base) / segment.length)
            else:
                _check_disks(key, segment, x, y, (s - base) / segment.length)
        base += segment.full_length


def _points(cable: Cable, end: float, base: float, segment: Segment) -> list[tuple[float, float, float]]:
    """(x, y, s) in m of the places to check in the segment that begins at the arc length `base` (m)."""
    top = base + segment.full_length
    if cable.via_points is not None:
        return [point for point in cable.via_points if base <= point[2] <= top]
    low, high = max(base, cable.start), min(top, end)
    if high - low <= 1e-9:
        return []
    return [(*cable.place(s, end), s) for s in (low, (low + high) / 2, high)]


def _check_wall(key: str, segment: Segment, x: float, y: float, part: float) -> None:
    part = min(max(part, 0.0), 1.0)
    if segment.contains(x, y, part):
        return
    outline, lumens = segment.outline(part), segment.lumen_outlines(part)
    radius = math.hypot(x, y)
    if outline.round and all(lumen.round for lumen in lumens):
        inner = lumens[0].half_width if lumens else 0.0
        raise ValueError(
            f"{key} runs {radius * 1e3:g} mm from the axis in segment '{segment.name}';"
            f" allowed: within its wall, {inner * 1e3:g} to {outline.half_width * 1e3:g} mm"
        )
    inside = next((lumen for lumen in lumens if lumen.gauge(x, y) < 1.0), None)
    where = f"in its lumen, {inside}" if inside else f"outside its outline, {outline}"
    raise ValueError(f"{key} runs at ({x * 1e3:g}, {y * 1e3:g}) mm in segment '{segment.name}', {where}")


def _check_disks(key: str, segment: Segment, x: float, y: float, part: float) -> None:
    assert segment.disks is not None  # the caller
    outline = segment.outline(min(max(part, 0.0), 1.0))
    radius, reach = math.hypot(x, y), segment.disks.outer_diameter / 2
    if radius > reach:
        raise ValueError(
            f"{key} runs {radius * 1e3:g} mm from the axis in segment '{segment.name}';"
            f" allowed: inside its disks, up to {reach * 1e3:g} mm"
        )
    if outline.gauge(x, y) < 1.0:
        raise ValueError(
            f"{key} runs {radius * 1e3:g} mm from the axis in segment '{segment.name}', inside the backbone ({outline});"
            " a cable of a segment with disks runs outside its backbone"
        )
