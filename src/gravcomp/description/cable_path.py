"""The checks that a cable runs inside the body or through the disks, and neither crosses nor repeats another."""

import dataclasses
import itertools
import math
from collections.abc import Callable, Sequence

import numpy as np

from gravcomp.description.cable import Cable
from gravcomp.description.pieces import Piece, piece_at
from gravcomp.description.segment import Segment

# Places in every piece and every stretch between two via points at which a cable is checked.
_PLACES = 9
# Two cables that come nearer than this part of the section's width cross.
_CROSSING = 2e-3


@dataclasses.dataclass(frozen=True)
class CableRun:
    """A cable in the robot: its start and end as arc lengths in m, and `place`, which gives (x, y) in m at an arc length."""

    cable: Cable
    end: float
    place: Callable[[float], tuple[float, float]]

    @property
    def start(self) -> float:
        """Arc length in m of the first point."""
        return self.cable.start if self.cable.via_points is None else self.cable.via_points[0][2]


def check_path(
    key: str, run: CableRun, pieces: Sequence[Piece], segments: Sequence[Segment], length: float, hint: Callable[[float], str]
) -> None:
    """Raise ValueError, naming `key`, when the cable leaves the robot's length, the wall of a segment or its disks.

    hint: returns what may be wrong with the length, after the end of a cable that is beyond it.
    """
    if run.end > length * (1 + 1e-9):
        raise ValueError(
            f"{key} ends at {run.end * 1e3:g} mm; allowed: up to the robot's length {length * 1e3:g} mm{hint(run.end)}"
        )
    if run.cable.via_points is None and run.start >= run.end:
        raise ValueError(f"{key}.start_mm is {run.start * 1e3:g}; allowed: below its end at {run.end * 1e3:g}")
    for piece in pieces:
        segment = segments[[s.name for s in segments].index(piece.segment)]
        points = _points(run, piece)
        for x, y, s in points[-1:] + points:  # most tapers are narrowest at the tip
            if segment.disks is None:
                _check_wall(key, piece, x, y, s)
            else:
                _check_disks(key, piece, segment, x, y, s)


def check_crossings(runs: Sequence[CableRun], pieces: Sequence[Piece]) -> None:
    """Raise ValueError where two cables cross or are the same line; a body from a file has no pieces.

    Cables that share a channel or only begin or end together do not cross.
    """
    ends = [run.place(s) for run in runs for s in (run.start, run.end, *_via_heights(run))]
    widest = max((math.hypot(*place) for place in ends), default=0.0)
    # A path that turns back is not known from its arc length alone.
    onward = [r for r in runs if not r.cable.via_points or all(a[2] < b[2] for a, b in itertools.pairwise(r.cable.via_points))]
    s = np.array(sorted({height for run in onward for height in _heights(run, pieces)}))
    if len(onward) < 2 or len(s) < 2:
        return
    # Beyond its ends the place of a cable is that at its end, and is not used.
    places = np.array([[run.place(min(max(height, run.start), run.end)) for height in s.tolist()] for run in onward])
    start, end = (np.array([getattr(run, name) for run in onward]) for name in ("start", "end"))
    one, other = np.triu_indices(len(onward), 1)
    low, high = np.maximum(start[one], start[other]), np.minimum(end[one], end[other])
    both, apart = (s >= low[:, None]) & (s <= high[:, None]), places[one] - places[other]
    same = (both.sum(axis=1) > 1) & (start[one] == start[other]) & (end[one] == end[other])
    same &= ~(both & apart.any(axis=2)).any(axis=1)
    crossed = _crossings(s, both, apart, np.array([_half_width(pieces, height, widest) for height in s.tolist()]))
    for pair in np.flatnonzero(same | ~np.isnan(crossed))[:1]:
        names = f"the cables '{onward[one[pair]].cable.name}' and '{onward[other[pair]].cable.name}'"
        if same[pair]:
            raise ValueError(f"{names} are the same line; leave one out or move it")
        raise ValueError(f"{names} cross at {crossed[pair] * 1e3:.4g} mm along the robot; let their channels keep a distance")


def _half_width(pieces: Sequence[Piece], s: float, otherwise: float) -> float:
    """Half the width (m) of the section at the arc length s (m); `otherwise` in a body from a file, which is not read here."""
    return piece_at(pieces, s).section(s)[0].half_width if pieces else otherwise


def _heights(run: CableRun, pieces: Sequence[Piece]) -> list[float]:
    """Arc lengths (m) of the points at which a cable is compared with others; between them it runs straight in a body."""
    if pieces:
        return [s for piece in pieces for s in _places(run, piece)]
    return [run.start, *_via_heights(run), run.end]


def _via_heights(run: CableRun) -> list[float]:
    return [point[2] for point in run.cable.via_points or ()]


def _crossings(s: np.ndarray, both: np.ndarray, apart: np.ndarray, half_width: np.ndarray) -> np.ndarray:
    """Return the first arc length (p,) at which the two cables of each pair come together and part again; nan where none do.

    both (p, k): whether both cables are there at the arc lengths s (k,); apart (p, k, 2): the vectors from one to the other;
    half_width (k,) in m: of the sections there.
    """
    near = _CROSSING * 2 * half_width
    clear = both & (np.hypot(apart[..., 0], apart[..., 1]) > near)
    step = np.diff(apart, axis=1)
    size, along = (step**2).sum(axis=2), -(apart[:, :-1] * step).sum(axis=2)
    part = np.clip(along / np.where(size > 0.0, size, 1.0), 0.0, 1.0)
    nearest = apart[:, :-1] + part[..., None] * step
    # They come near within a stretch, and are apart before and after it.
    met = both[:, :-1] & both[:, 1:] & (np.hypot(nearest[..., 0], nearest[..., 1]) < near[:-1])
    met &= np.logical_or.accumulate(clear, axis=1)[:, :-1]
    met &= np.logical_or.accumulate(clear[:, ::-1], axis=1)[:, -2::-1]
    pairs, first = np.arange(len(met)), met.argmax(axis=1)
    return np.where(met.any(axis=1), s[first] + part[pairs, first] * (s[first + 1] - s[first]), np.nan)


def _points(run: CableRun, piece: Piece) -> list[tuple[float, float, float]]:
    """Points (x, y, s) in m of a cable in a piece, via points among them."""
    if run.cable.via_points is None:
        return [(*run.place(s), s) for s in _places(run, piece)]
    via, parts = np.array(run.cable.via_points), np.linspace(0.0, 1.0, _PLACES)[:, None]
    legs = np.concatenate([a + parts * (b - a) for a, b in itertools.pairwise(via)])
    inside = (legs[:, 2] >= piece.start) & (legs[:, 2] <= piece.start + piece.length)
    return [(x, y, s) for x, y, s in legs[inside].tolist()]


def _places(run: CableRun, piece: Piece) -> list[float]:
    """Arc lengths (m) of the points of a cable in a piece."""
    if run.cable.via_points is not None:
        return [s for _, _, s in _points(run, piece)]
    low, high = max(piece.start, run.start), min(piece.start + piece.length, run.end)
    step = (high - low) / (_PLACES - 1)
    return [] if high - low <= 1e-9 else [*(low + k * step for k in range(_PLACES - 1)), high]


def _check_wall(key: str, piece: Piece, x: float, y: float, s: float) -> None:
    outline, lumens = piece.section(s)
    outside = outline.gauge(x, y) > 1.0 + 1e-9
    crossed = next((lumen for lumen in lumens if lumen.gauge(x, y) < 1.0 - 1e-9), None)
    if not outside and crossed is None:
        return
    radius = math.hypot(x, y)
    if outline.round and all(lumen.round for lumen in lumens):
        inner = lumens[0].half_width if lumens else 0.0
        raise ValueError(
            f"{key} runs {radius * 1e3:g} mm from the axis in segment '{piece.segment}';"
            f" allowed: within its wall, {inner * 1e3:g} to {outline.half_width * 1e3:g} mm"
        )
    where = f"in its lumen, {crossed}" if crossed else f"outside its outline, {outline}"
    raise ValueError(f"{key} runs at ({x * 1e3:g}, {y * 1e3:g}) mm in segment '{piece.name}', {where}")


def _check_disks(key: str, piece: Piece, segment: Segment, x: float, y: float, s: float) -> None:
    assert segment.disks is not None  # the caller
    outline = piece.visible.section(s)[0]
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
