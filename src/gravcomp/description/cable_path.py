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
    for one, other in itertools.combinations(onward, 2):
        heights = sorted({s for run in (one, other) for s in _heights(run, pieces)})
        low, high = max(one.start, other.start), min(one.end, other.end)
        s = np.array([height for height in heights if low <= height <= high])
        if len(s) < 2:
            continue
        apart = np.array([one.place(height) for height in s])
        apart -= [other.place(height) for height in s]
        if not apart.any() and (one.start, one.end) == (other.start, other.end):
            raise ValueError(
                f"the cables '{one.cable.name}' and '{other.cable.name}' are the same line; leave one out or move it"
            )
        place = _crossing(s, apart, np.array([_half_width(pieces, height, widest) for height in s]))
        if place is not None:
            raise ValueError(
                f"the cables '{one.cable.name}' and '{other.cable.name}' cross at {place * 1e3:.4g} mm along the robot;"
                " let their channels keep a distance"
            )


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


def _crossing(s: np.ndarray, apart: np.ndarray, half_width: np.ndarray) -> float | None:
    """The arc length at which the distance vectors (k, 2) at the arc lengths s (k,) pass through zero; None where none do.

    half_width (k,) in m: of the sections there.
    """
    near = _CROSSING * 2 * half_width
    distance = np.hypot(*apart.T)
    for k in range(len(s) - 1):
        step = apart[k + 1] - apart[k]
        size = step @ step
        at = min(max(-(apart[k] @ step) / size, 0.0), 1.0) if size else 0.0
        # They come near within this stretch, and are apart before and after it.
        apart_before, apart_after = (bool((distance[part] > near[part]).any()) for part in (slice(k + 1), slice(k + 1, None)))
        if np.hypot(*(apart[k] + at * step)) < near[k] and apart_before and apart_after:
            return float(s[k] + at * (s[k + 1] - s[k]))
    return None


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
    return [] if high - low <= 1e-9 else np.linspace(low, high, _PLACES).tolist()


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
