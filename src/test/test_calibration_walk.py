"""Shapes at rest one after another, as a calibration predicts them."""

import dataclasses

import numpy as np
import pytest
from coarse_article import coarse

from gravcomp.calibration.held_back import held_back
from gravcomp.calibration.measured import Course
from gravcomp.calibration.walk import Step, Walk
from gravcomp.simulation import RobotModel


def test_a_step_next_to_a_known_one_has_its_friction_not_that_of_the_last_step():
    robot = coarse()
    cables = tuple(dataclasses.replace(cable, friction=0.3, sheath_angle=1.0) for cable in robot.cables)
    walk = Walk(RobotModel(dataclasses.replace(robot, cables=cables)), ())
    gravity = np.array([-9.81, 0.0, 0.0])
    pulls = [np.full(6, pull) * [1, 0, 0, 1, 0, 0] for pull in (1e-3, 3e-3, 2e-3)]  # the last is paid out
    walked = walk.run([Step(gravity, pull, None, k) for k, pull in enumerate(pulls)], np.zeros(0))
    for known in walked:
        near = walk.near(Step(gravity, known.displacement, None, known.window), known)
        assert np.abs(near - known.tip).max() < 1e-6


MOST = np.mean([2.0 * (6 / q) ** 0.5 for q in (5, 3, 1)])  # mm, of a reach of 2 mm


def course_of(places: list[float], windows: list[int], begins: list[bool]) -> Course:
    """The course of a tip through these places, in mm along x, with directions of 0.02 rad for each; windows: samples."""
    x = np.array(places)
    tip = np.column_stack([1e-3 * x, *np.zeros((2, len(x))), 0.02 * x, *np.zeros((2, len(x)))])
    return Course(tip, np.array(begins), tuple(np.array(windows)[:, None]))


def test_friction_inside_the_material_holds_a_tip_back_against_its_last_move():
    """Along the way by what all sections hold at most; at the beginning of a trial nothing holds it."""
    reach, length = 2e-3, 0.1
    places = [0.0, 1.0, 10.0, 9.0, -5.0, 7.0]
    found = held_back(course_of(places, list(range(6)), [True, *[False] * 4, True]), reach, length)
    np.testing.assert_allclose(1e3 * found[:, 0], [0.0, 1.0, MOST, MOST - 1.0, -MOST, 0.0], atol=1e-12)
    turn = np.mean([0.08 / 3 * (6 / q) ** (2 / 3) for q in (5, 3, 1)])
    np.testing.assert_allclose(found[:, 3], [0.0, 0.02, turn, turn - 0.02, -turn, 0.0], atol=1e-12)
    assert not found[:, [1, 2, 4, 5]].any()


def test_a_tip_that_swings_about_its_rest_is_held_back_by_little():
    """The same two rests: as a slow move they differ by all that the friction holds."""
    swings = [20.0 + 15.0 * (-0.85) ** k for k in range(40)]
    slow = held_back(course_of([0.0, 20.0], [1], [True, False]), 2e-3, 0.1)
    swung = held_back(course_of([0.0, *swings, 20.0], [41], [True, *[False] * 41]), 2e-3, 0.1)
    assert 1e3 * slow[0, 0] == pytest.approx(MOST) and abs(1e3 * swung[0, 0]) < 0.2 * MOST
