"""Shapes at rest one after another, as a calibration predicts them."""

import dataclasses

import numpy as np
from coarse_article import coarse

from gravcomp.calibration.held_back import held_back
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


def test_friction_inside_the_material_holds_a_tip_back_against_its_last_move():
    """Along the way by its reach at most, however long it takes; a relaxed robot starts again."""
    reach, length = 2e-3, 0.1
    places = [(None, 0.0), (1.0, 1.0), (100.0, 10.0), (1.0, 9.0), (1.0, -5.0), (None, 7.0)]
    steps = [
        Step(np.zeros(3), np.zeros(0), duration, number, tip=np.array([1e-3 * x, 0.0, 0.0, 0.02 * x, 0.0, 0.0]))
        for number, (duration, x) in enumerate(places)
    ]
    found = held_back(steps, reach, length)
    np.testing.assert_allclose(1e3 * found[:, 0], [0.0, 1.0, 7 / 3, 4 / 3, -7 / 3, 0.0], atol=1e-12)
    np.testing.assert_allclose(found[:, 3], [0.0, 0.02, 0.14 / 3, 0.08 / 3, -0.14 / 3, 0.0], atol=1e-12)  # by 2 reach / length
    assert not found[:, [1, 2, 4, 5]].any()
