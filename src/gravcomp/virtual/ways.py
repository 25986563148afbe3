"""Ways of the cables along the rod, from the description.

A cable runs in a channel that follows the body, at its place in every section or, between via points, straight from one to the
next in the straightened robot. In a segment with spacer disks it runs straight from disk to disk; the base guides it like a disk.
"""

import numpy as np

from gravcomp.cables.disks import disk_heights
from gravcomp.description import Cable, Robot
from gravcomp.virtual.routing import Routing


def element_marks(robot: Robot) -> list[float]:
    """Return the arc lengths (m) at which an element of the rod has to end for its cables: starts, ends, via points, disks."""
    marks = [float(height) for height in disk_heights(robot)]
    for cable in robot.cables:
        marks += [point[2] for point in cable.via_points] if cable.via_points else [cable.start, robot.cable_end(cable)]
    return marks


def routing_of(robot: Robot, ends: np.ndarray) -> Routing:
    """Return the ways of the cables along the elements between `ends` (n + 1,) m."""
    n, m = len(ends) - 1, len(robot.cables)
    offset, slope, inside = np.zeros((m, n, 3)), np.zeros((m, n, 3)), np.zeros((m, n), dtype=bool)
    start, end = np.zeros(m, dtype=np.int64), np.zeros(m, dtype=np.int64)
    free = _free_elements(robot, ends)
    guides = disk_heights(robot)
    chords: list[tuple[int, int, int, np.ndarray, np.ndarray]] = []
    for c, cable in enumerate(robot.cables):
        first = cable.via_points[0][2] if cable.via_points else cable.start
        start[c], end[c] = _node(ends, first), _node(ends, robot.cable_end(cable))
        at = np.array([(*robot.cable_place(cable, s), 0.0) for s in ends])
        passes = np.arange(start[c], end[c])
        inside[c, passes] = ~free[passes]
        offset[c], slope[c] = (at[1:] + at[:-1]) / 2, (at[1:] - at[:-1]) / np.diff(ends)[:, None]
        stops = _stops(cable, guides, ends, free, int(start[c]), int(end[c]))
        chords += [(c, a, b, at[a], at[b]) for a, b in zip(stops, stops[1:]) if free[a:b].all()]
    numbers = np.array([chord[:3] for chord in chords], dtype=np.int64).reshape(-1, 3)
    holes = np.array([chord[3:] for chord in chords]).reshape(-1, 2, 3)
    tendon, base_side, tip_side = (np.ascontiguousarray(column) for column in numbers.T)
    hole_from, hole_to = np.ascontiguousarray(holes[:, 0]), np.ascontiguousarray(holes[:, 1])
    return Routing(offset, slope, inside, start, end, tendon, base_side, tip_side, hole_from, hole_to)


def _free_elements(robot: Robot, ends: np.ndarray) -> np.ndarray:
    """Whether each element (n,) belongs to a backbone, outside which cables run free."""
    free, base = np.zeros(len(ends) - 1, dtype=bool), 0.0
    middle = (ends[1:] + ends[:-1]) / 2
    for segment in robot.segments:
        if segment.disks:
            free |= (middle > base) & (middle < base + segment.full_length)
        base += segment.full_length
    return free


def _stops(cable: Cable, guides: np.ndarray, ends: np.ndarray, free: np.ndarray, start: int, end: int) -> list[int]:
    """Cross-sections at which the cable is guided: disks or via points, its ends, and where a backbone begins or ends."""
    heights = guides if cable.via_points is None else np.array([point[2] for point in cable.via_points])
    stops = {start, end} | {_node(ends, height) for height in heights}
    stops |= {k for k in range(1, len(free)) if free[k] != free[k - 1]}
    return sorted(k for k in stops if start <= k <= end)


def _node(ends: np.ndarray, s: float) -> int:
    return int(np.argmin(np.abs(ends - s)))
