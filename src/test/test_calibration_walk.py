"""Shapes at rest one after another, as a calibration predicts them."""

import dataclasses

import numpy as np
from coarse_article import coarse

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
