"""Courses in which the robot swings: what shows its damping."""

import dataclasses

import numpy as np

from gravcomp.calibration.measured import Measured, rests_of
from gravcomp.calibration.parameters import StaticParameters
from gravcomp.calibration.standstill import Standstill

_COURSES = 2
_FEWEST = 3  # samples of a course
_DENSE = 0.2  # of a window at rest, between two samples


def moving(measured: Measured, parameters: StaticParameters, still: Standstill) -> list[Measured]:
    """Return the courses with the fastest motion, each from a rest or a trial's start on, with cables and gravity corrected."""
    found = []
    for trial in measured.trials():
        if len(trial.time) < _FEWEST or np.median(np.diff(trial.time)) >= _DENSE * still.time:
            continue
        for first in dict.fromkeys([0, *(last for _, last in rests_of(trial, still))]):
            rows = np.flatnonzero((trial.time >= trial.time[first]) & (trial.time <= trial.time[first] + still.motion))
            if len(rows) < _FEWEST:  # the rest lasts until the end of the trial
                continue
            course = trial.rows(rows)
            reach = still.samples(course.time)
            moved = np.linalg.norm(course.tip_position[reach:] - course.tip_position[:-reach], axis=1).max(initial=0.0)
            turned = np.ptp(course.gravity / np.linalg.norm(course.gravity, axis=1, keepdims=True), axis=0).max()
            if moved > still.moving and turned < 4.0 * still.gravity:
                wound = parameters.winding * course.displacement + parameters.offset
                gravity = parameters.true_gravity(course.gravity)
                found.append((moved, dataclasses.replace(course, displacement=wound, gravity=gravity)))
    found.sort(key=lambda entry: -entry[0])
    return [course for _, course in found[:_COURSES]]
