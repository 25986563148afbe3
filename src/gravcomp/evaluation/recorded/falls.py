"""Free falls in a recorded course: the robot is held by hand as it is at rest, its cables are paid out, and it is let go.

The moment of letting go is not measured. At first the tip moves as d = a (t - t_0)^2 / 2, so sqrt(d) of the first samples is a
straight line that begins at t_0.
"""

import numpy as np

from gravcomp.calibration.course import STRAIGHT
from gravcomp.calibration.measured import Measured
from gravcomp.description import Robot
from gravcomp.evaluation.recorded.course import RELEASED, Course
from gravcomp.mesh.robot_axis import rest_tip

FALLEN, WITHIN = 0.08, 1.8
"""A fall: the tip is more than FALLEN lengths from where it is at rest within WITHIN first periods."""
PAID_OUT = 3.6
"""First periods for which the cables must have been paid out before: a robot that its cables let down does not fall."""
_BEGINNING = (0.01, 0.1)  # lengths: distances of the samples from which the moment of letting go is computed
_LONGEST = 14.0  # first periods of a fall
_SHORTEST = 3.6


def falls(course: Course, robot: Robot, period: float) -> list[np.ndarray]:
    """Return the rows of each fall, from the last sample near the shape at rest on; period in s: the robot's first."""
    length = robot.length
    distance, near = np.linalg.norm(course.tip_position - rest_tip(robot)[0], axis=1), STRAIGHT * length
    released = course.phase == RELEASED
    found: list[np.ndarray] = []
    last = -1
    for start in np.flatnonzero((distance[:-1] <= near) & (distance[1:] > near) & released[:-1]).tolist():
        begin = course.time[start]
        soon = (course.time > begin) & (course.time <= begin + WITHIN * period)
        before = (course.time >= begin - PAID_OUT * period) & (course.time <= begin)
        paid_out = begin - course.time[0] >= PAID_OUT * period and released[before].all()
        if start <= last or not paid_out or not (distance[soon] > FALLEN * length).any():
            continue
        end = int(np.searchsorted(course.time, begin + _LONGEST * period, side="right"))
        # A fall ends where the cables are pulled again or the next fall begins.
        over = np.flatnonzero(~released[start:end] | ((distance[start:end] <= near) & (np.arange(end - start) > 0)))
        end = start + int(over[0]) if len(over) else end
        if course.time[end - 1] - begin >= _SHORTEST * period:
            found.append(np.arange(start, end))
            last = end
    return found


def as_measured(course: Course, source: str, robot: Robot) -> Measured:
    """Return the fall as a course that begins at the shape at rest, at the moment of letting go."""
    tip, direction = rest_tip(robot)
    let_go = _let_go(course.time, np.linalg.norm(course.tip_position - tip, axis=1) / robot.length)
    course = course.rows(course.time > let_go)
    count = len(course.time) + 1
    return Measured(
        source=source,
        trial=np.zeros(count, int),
        time=np.append(let_go, course.time) - let_go,
        gravity=course.gravity[np.append(0, np.arange(count - 1))],
        displacement=np.full((count, len(robot.cables)), np.nan),
        tip_position=np.vstack([tip, course.tip_position]),
        tip_direction=np.vstack([direction, course.tip_direction]),
    )


def _let_go(time: np.ndarray, distance: np.ndarray) -> float:
    """Return the time (s) at which the line through sqrt(distance) of the first samples begins; distance in lengths.

    With fewer than two such samples it is the time of the first sample.
    """
    low, high = _BEGINNING
    first = np.arange(np.argmax(distance >= low), np.argmax(distance > high))
    if len(first) < 2:
        return float(time[0])
    slope, offset = np.polyfit(time[first], np.sqrt(distance[first]), 1)
    return float(np.clip(-offset / slope, time[0] - 0.1, time[first[0]]))
