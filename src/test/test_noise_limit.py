"""What noise leaves open after a calibration, and what is said of a robot that hardly sags."""

import numpy as np
import pytest
from coarse_article import coarse
from test_calibration_intervals import GROUPS, TRUE_OFFSET, TRUE_RATIO, measured_springs

from gravcomp.calibration.fit import TipNoise, fit_statics
from gravcomp.calibration.measured import StillWindows
from gravcomp.calibration.noise_limit import limited, open_error, sag_of
from gravcomp.calibration.parameters import StaticParameters, starting_parameters
from gravcomp.calibration.report import calibration_result
from gravcomp.calibration.statics import StaticPrediction, StaticPredictor


def test_the_error_that_noise_leaves_open_is_that_of_the_modelled_tips():
    """Of fits to ten draws of the noise: their tips against the true ones, which no fit sees."""
    robot = coarse()
    described = np.array([material.youngs_modulus for material in robot.materials])
    compliance = np.array([robot.cable_compliance(cable) for cable in robot.cables])
    true = StaticParameters(TRUE_RATIO * described, np.full(len(robot.cables), TRUE_OFFSET), compliance)
    squares, expected = [], []
    for seed in range(10):
        springs = measured_springs(robot, seed, 3e-3)
        fit = fit_statics(robot, springs.windows, groups=GROUPS, noise=TipNoise(stiffness=0.0), predictor=springs)
        missed = fit.after.tip[:, :3] - springs.predict(true).tip[:, :3]
        squares.append(float((missed**2).sum(axis=1).mean()))
        expected.append(fit.open_error)
    assert np.mean(expected) == pytest.approx(np.sqrt(np.mean(squares)), rel=0.3)
    result = calibration_result("a", "b", fit, None, [], 0.01)
    assert result.data["open_error_mm"] == pytest.approx(1e3 * fit.open_error)
    assert fit.sag is None and result.data["sag_mm"] is None  # it is never released


def test_the_error_weighs_windows_by_their_shares():
    by = np.zeros((2, 3, 1))
    by[0, 0, 0], by[1, 2, 0] = 3.0, 4.0
    assert open_error(by, np.array([[4.0]]), np.array([1.0, 0.0])) == pytest.approx(6.0)
    assert open_error(by, np.array([[4.0]]), np.array([1.0, 1.0])) == pytest.approx(np.sqrt((36.0 + 64.0) / 2.0))


def test_a_robot_that_hardly_sags_has_its_limit_named():
    """The sag is that of the released robot, in the window where it is largest."""
    robot = coarse()
    count = len(robot.cables)
    gravity = np.array([[-9.81, 0.0, 0.0], [0.0, 0.0, -9.81], [-9.81, 0.0, 0.0]])
    pulled = np.full((3, count), np.nan)
    pulled[2] = 2e-3
    windows = StillWindows(gravity, pulled, np.zeros((3, 3)))
    predicted = StaticPredictor(robot, windows).predict(starting_parameters(robot, ()))
    sag = sag_of(robot, windows, predicted)
    straight = np.array([0.0, 0.0, robot.length])
    assert sag == pytest.approx(np.linalg.norm(predicted.tip[0, :3] - straight), rel=1e-6) and 0.02 < sag < 0.04
    assert sag_of(robot, windows, StaticPrediction(predicted.tip, np.ones((3, count)))) is None
    assert limited(0.009 * sag, sag) == "" and limited(1.0, None) == ""
    assert "2.1% of the 2.5 mm" in limited(0.021 * 2.5e-3, 2.5e-3) and "0.053 mm open" in limited(0.021 * 2.5e-3, 2.5e-3)
