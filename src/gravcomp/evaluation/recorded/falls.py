"""Free falls in a recorded course: the robot is held straight by hand, its cables are paid out, and it is let go.

The moment of letting go is not measured. At first the tip moves as d = a (t - t_0)^2 / 2, so sqrt(d) of the first samples is a
straight line that begins at t_0.
"""

import numpy as np

from gravcomp.calibration.course import STRAIGHT
from gravcomp.calibration.measured import Measured
from gravcomp.evaluation.recorded.course import RELEASED, Course

FALLEN, WITHIN = 8e-3, 0.5
"""A fall: the tip is more than FALLEN m from the straight robot's within WITHIN s."""
PAID_OUT = 1.0
"""s for which the cables must have been paid out before: a robot that its cables let down does not fall."""
_BEGINNING = (1e-3, 10e-3)  # m, distances of the samples from which the moment of letting go is computed
_LONGEST = 4.0  # s of a fall
_SHORTEST = 1.0  # s


def falls(course: Course, length: float) -> list[np.ndarray]:
    """Return the rows of each fall of a robot of `length` m, from the last sample near straight on."""
    distance, near = np.linalg.norm(course.tip_position - [0.0, 0.0, length], axis=1), STRAIGHT * length
    released = course.phase == RELEASED
    found: list[np.ndarray] = []
    last = -1
    for start in np.flatnonzero((distance[:-1] <= near) & (distance[1:] > near) & released[:-1]).tolist():
        begin = course.time[start]
        soon = (course.time > begin) & (course.time <= begin + WITHIN)
        before = (course.time >= begin - PAID_OUT) & (course.time <= begin)
        paid_out = begin - course.time[0] >= PAID_OUT and released[before].all()
        if start <= last or not paid_out or not (distance[soon] > FALLEN).any():
            continue
        end = int(np.searchsorted(course.time, begin + _LONGEST, side="right"))
        # A fall ends where the cables are pulled again or the next fall begins.
        over = np.flatnonzero(~released[start:end] | ((distance[start:end] <= near) & (np.arange(end - start) > 0)))
        end = start + int(over[0]) if len(over) else end
        if course.time[end - 1] - begin >= _SHORTEST:
            found.append(np.arange(start, end))
            last = end
    return found


def as_measured(course: Course, source: str, length: float, cables: int) -> Measured:
    """Return the fall as a course that begins straight at the moment of letting go."""
    straight = np.array([0.0, 0.0, length])
    let_go = _let_go(course.time, np.linalg.norm(course.tip_position - straight, axis=1))
    course = course.rows(course.time > let_go)
    count = len(course.time) + 1
    return Measured(
        source=source,
        trial=np.zeros(count, int),
        time=np.append(let_go, course.time) - let_go,
        gravity=course.gravity[np.append(0, np.arange(count - 1))],
        displacement=np.full((count, cables), np.nan),
        tip_position=np.vstack([straight, course.tip_position]),
        tip_direction=np.vstack([[0.0, 0.0, 1.0], course.tip_direction]),
    )


def _let_go(time: np.ndarray, distance: np.ndarray) -> float:
    """Return the time (s) at which the line through sqrt(distance) of the first samples begins.

    With fewer than two such samples it is the time of the first sample.
    """
    low, high = _BEGINNING
    first = np.arange(np.argmax(distance >= low), np.argmax(distance > high))
    if len(first) < 2:
        return float(time[0])
    slope, offset = np.polyfit(time[first], np.sqrt(distance[first]), 1)
    return float(np.clip(-offset / slope, time[0] - 0.1, time[first[0]]))
