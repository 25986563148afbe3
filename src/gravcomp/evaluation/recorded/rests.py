"""Stretches at rest in a recorded course, with their mean errors."""

import math
from dataclasses import dataclass

import numpy as np

from gravcomp.evaluation import metrics
from gravcomp.evaluation.recorded.course import BETWEEN, Course

STILL_TIME = 0.5  # s: length of a window
STILL_TIP = 0.6e-3  # m: largest motion of the tip in a window
STILL_GRAVITY = math.radians(0.5)  # rad: of the gravity direction


@dataclass(frozen=True)
class Rest:
    """One stretch at rest: its rows, its phase, the mean direction of gravity (3,), and the mean errors."""

    rows: np.ndarray
    phase: int
    down: np.ndarray
    errors: metrics.TipErrors[float]


def rests(course: Course) -> list[Rest]:
    """Return the last window at rest of every stretch between two motions, changes of phase or changes of target."""
    count = max(2, round(STILL_TIME / max(float(np.median(np.diff(course.time))), 1e-6)))
    found: list[Rest] = []
    last: Rest | None = None
    for start in range(0, len(course.time) - count + 1, max(1, count // 2)):
        rest = _rest(course, np.arange(start, start + count))
        if last is not None and (rest is None or rest.phase != last.phase):
            found.append(last)
        last = rest
    return found if last is None else [*found, last]


def errors_of(course: Course) -> metrics.TipErrors[np.ndarray]:
    """Return the errors of the measured tip to the target, (t,) each."""
    return metrics.tip_errors(course.tip_position, course.tip_direction, course.target_position, course.target_direction)


def _rest(course: Course, rows: np.ndarray) -> Rest | None:
    """Return the rest in a window, None where the window is not at rest."""
    window = course.rows(rows)
    down = window.gravity / np.linalg.norm(window.gravity, axis=1, keepdims=True)
    at_rest = (
        window.phase[0] != BETWEEN
        and (window.phase == window.phase[0]).all()
        and np.ptp(window.tip_position, axis=0).max() <= STILL_TIP
        and np.ptp(down, axis=0).max() <= STILL_GRAVITY
        and np.ptp(window.target_position, axis=0).max() == 0.0
    )
    if not at_rest:
        return None
    return Rest(rows, int(window.phase[0]), down.mean(axis=0), metrics.means(errors_of(window)))
