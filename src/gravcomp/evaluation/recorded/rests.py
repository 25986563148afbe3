"""Stretches at rest in a recorded course, with their mean errors. What counts as rest is that of a calibration."""

from dataclasses import dataclass

import numpy as np

from gravcomp.calibration.standstill import Standstill
from gravcomp.evaluation import metrics
from gravcomp.evaluation.recorded.course import BETWEEN, Course


@dataclass(frozen=True)
class Rest:
    """One stretch at rest: its rows, its phase, the mean direction of gravity (3,), and the mean errors."""

    rows: np.ndarray
    phase: int
    down: np.ndarray
    errors: metrics.TipErrors[float]


def rests(course: Course, still: Standstill) -> list[Rest]:
    """Return the last window at rest of every stretch between two motions, changes of phase or changes of target."""
    count, limit = still.samples(course.time), still.tip_limit(course.tip_position)
    found: list[Rest] = []
    last: Rest | None = None
    for start in range(0, len(course.time) - count + 1, max(1, count // 2)):
        rest = _rest(course, np.arange(start, start + count), limit, still.gravity)
        if last is not None and (rest is None or rest.phase != last.phase):
            found.append(last)
        last = rest
    return found if last is None else [*found, last]


def errors_of(course: Course) -> metrics.TipErrors[np.ndarray]:
    """Return the errors of the measured tip to the target, (t,) each."""
    return metrics.tip_errors(course.tip_position, course.tip_direction, course.target_position, course.target_direction)


def _rest(course: Course, rows: np.ndarray, tip: float, gravity: float) -> Rest | None:
    """Return the rest in a window, None where it is not at rest: the tip moves by more than `tip` (m), or gravity turns (rad)."""
    window = course.rows(rows)
    down = window.gravity / np.linalg.norm(window.gravity, axis=1, keepdims=True)
    at_rest = (
        window.phase[0] != BETWEEN
        and (window.phase == window.phase[0]).all()
        and np.ptp(window.tip_position, axis=0).max() <= tip
        and np.ptp(down, axis=0).max() <= gravity
        and np.ptp(window.target_position, axis=0).max() == 0.0
    )
    if not at_rest:
        return None
    return Rest(rows, int(window.phase[0]), down.mean(axis=0), metrics.means(errors_of(window)))
