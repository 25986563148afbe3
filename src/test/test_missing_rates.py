"""The turn in a gap of a random motion, from the rates around it."""

import math

import numpy as np
import pytest

from gravcomp.orientation.missing_rates import Swing, likeliest_turn
from gravcomp.orientation.swings import Swings

TIMES = (-0.05, 0.0, 0.4)
NOISE = (1e-4, 1e-4, 4e-4)
PARTS = (Swing(0.5, 3.0), Swing(0.02, 40.0))


def covariance(first, second):
    apart = math.sqrt(3.0) * np.abs(np.subtract.outer(first, second))
    return sum(size * (1.0 + f * apart + (f * apart) ** 2 / 3.0) * np.exp(-f * apart) for size, f in PARTS)


def test_weights_and_variance_are_those_of_the_joint_distribution():
    """The integral is a sum over 2000 rates in the gap here."""
    step = 0.4 / 2000
    inside = step * (np.arange(2000) + 0.5)
    known = covariance(TIMES, TIMES) + np.diag(NOISE)
    angle = step * covariance(inside, TIMES).sum(axis=0)
    expected = np.linalg.solve(known, angle)
    weights, variance = likeliest_turn(PARTS, TIMES, NOISE, 0.4)
    assert weights == pytest.approx(expected, rel=0.02, abs=1e-4)
    assert variance == pytest.approx(step**2 * covariance(inside, inside).sum() - expected @ angle, rel=0.02)


def test_a_rate_that_hardly_changes_goes_on_and_one_that_swings_decays():
    slow, _ = likeliest_turn([Swing(1.0, 0.05)], TIMES, NOISE, 0.4)
    assert sum(slow) == pytest.approx(0.4, rel=1e-3)
    long = [likeliest_turn([Swing(1.0, 10.0)], (-0.05, 0.0, gap), NOISE, gap) for gap in (5.0, 10.0)]
    assert long[0][0] == pytest.approx(long[1][0], rel=1e-3)  # the rates around say nothing of the middle
    assert long[1][1] / long[0][1] == pytest.approx(2.0, rel=0.1)


def test_a_motion_that_begins_in_the_gap_is_expected():
    swings = Swings()
    for _ in range(200):
        swings.watch(0.01, (0.0, 0.0, 0.0))
    (mean, _, _), variance = swings.across(0.5, 0.01, (1.0, 0.0, 0.0), 0.0)
    assert 0.2 < mean < 0.5 and 0.03 < math.sqrt(variance) < 0.3
    assert swings.across(0.5, 0.01, (0.0, 0.0, 0.0), 0.0) == ((0.0, 0.0, 0.0), 0.0)


def test_a_gap_without_a_rate_before_it_has_the_one_after_it():
    (mean, _, _), variance = Swings().across(0.5, 0.01, (1.0, 0.0, 0.0), 0.0)
    assert mean == pytest.approx(1.0, abs=0.1) and variance > 0.0
