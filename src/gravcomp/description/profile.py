"""Sizes along a segment: given at its base, its stations and its tip, linear between."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from gravcomp.description.section import Station

# Keys of a station that belong to a round segment, to one with a `section`, and to both.
ROUND, OTHER, BOTH = ("outer_diameter",), ("width", "height"), ("lumen_diameter",)


def size_at(key: str, base: float, tip: float | None, stations: Sequence[Station], length: float, part: float) -> float:
    """Return the size `key` (m) at `part` of the segment's length (m).

    base (m): the size at its base, 0 where only the stations give it; tip (m): at its tip; None where it is not given.
    """
    given = [(station.z / length, getattr(station, key)) for station in stations if getattr(station, key) is not None]
    if base and (not given or given[0][0] > 0.0):
        given.insert(0, (0.0, base))
    if tip is not None and (not given or given[-1][0] < 1.0):
        given.append((1.0, tip))
    if not given:
        return 0.0
    place, size = zip(*given)
    return float(np.interp(part, place, size))


def check_stations(stations: Sequence[Station], length: float, round_outline: bool, ends: dict[str, tuple[bool, bool]]) -> None:
    """Raise ValueError for stations out of order or outside the segment, and for sizes that do not belong or are given twice.

    length (m): of the segment; ends: for every size whether the segment gives it at its base and at its tip by other keys.
    """
    before = -1.0
    for index, station in enumerate(stations):
        key = f"stations[{index}]"
        if station.z <= before:
            raise ValueError(f"{key}.z_mm is {station.z * 1e3:g}; allowed: above that of the station before, {before * 1e3:g}")
        if station.z > length * (1 + 1e-9):
            raise ValueError(f"{key}.z_mm is {station.z * 1e3:g}; allowed: up to the segment's length, {length * 1e3:g}")
        before = station.z
        sizes = [f.name for f in dataclasses.fields(station) if f.name != "z" and getattr(station, f.name) is not None]
        allowed = (*(ROUND if round_outline else OTHER), *BOTH)
        if not sizes:
            raise ValueError(f"{key} gives no size; allowed: {', '.join(f'{name}_mm' for name in allowed)}")
        for name in sizes:
            if name not in allowed:
                kind = "round" if round_outline else "not round"
                raise ValueError(f"{key}.{name}_mm is given, but the segment is {kind}: use {allowed[0]}_mm")
            at_base, at_tip = ends[name]
            if name in BOTH and not at_base and not (station.z == 0.0 or _given_at_base(stations, name)):
                raise ValueError(f"{key}.{name}_mm is given, but the segment has no {name}_mm at its base")
            if (at_base and station.z == 0.0) or (at_tip and station.z >= length * (1 - 1e-9)):
                end = "base" if station.z == 0.0 else "tip"
                raise ValueError(f"{key}.{name}_mm gives the size at the segment's {end} a second time; give it once")


def _given_at_base(stations: Sequence[Station], name: str) -> bool:
    return stations[0].z == 0.0 and getattr(stations[0], name) is not None
