"""Figures of a run: sag, errors to the target, agreement of the model, error of gravity, rates."""

import numpy as np
import pytest

from gravcomp.evaluation import run_figures
from gravcomp.evaluation.track import Track

STRAIGHT, UP = np.array([0.0, 0.0, 0.1]), np.array([0.0, 0.0, 1.0])


def track(values, rate=100.0):
    """A track of the values (n, 3) at `rate` Hz, from 0 s on."""
    result = Track(3)
    for k, row in enumerate(values):
        result.add(k / rate, *row)
    return result


def swinging(count=400):
    """Tips (n, 3) on a curve."""
    phase = np.linspace(0.0, 4 * np.pi, count)
    return np.stack([0.02 * np.sin(phase), 0.01 * np.cos(phase), 0.09 + 0 * phase], axis=1)


def test_sag_is_the_mean_distance_from_the_straight_tip():
    tips = track(np.vstack([np.tile([0.03, 0.0, 0.06], (100, 1)), np.tile(STRAIGHT, (100, 1))]))
    assert run_figures.sag(tips, STRAIGHT, 0.0, 1.0) == pytest.approx(0.05)
    assert run_figures.sag(tips, STRAIGHT, 1.0, 2.0) == pytest.approx(0.0)
    assert run_figures.sag(tips, STRAIGHT, 5.0, 6.0) is None


def test_residual_is_split_into_lateral_and_axial_error():
    tips = track(STRAIGHT + np.array([[3e-3, 0.0, -1e-3], [0.0, -4e-3, 1e-3]]))
    lateral, axial = run_figures.residual(tips, STRAIGHT, UP, 0.0, 1.0)
    assert lateral == pytest.approx(np.sqrt((9e-6 + 16e-6) / 2))
    assert axial == pytest.approx(1e-3)
    assert run_figures.residual(tips, STRAIGHT, UP, 5.0, 6.0) is None


def test_correlation_ignores_an_offset_and_needs_motion():
    truth = swinging()
    model = track(truth + np.array([1e-3, 0.0, 2e-3]))
    assert run_figures.correlation(track(truth), model, 0.0, 4.0) == pytest.approx(1.0, abs=1e-9)
    # At rest, and without common samples, there is no correlation.
    still = track(np.tile(STRAIGHT, (400, 1)))
    assert run_figures.correlation(still, model, 0.0, 4.0) is None
    assert run_figures.correlation(track(truth), model, 9.0, 10.0) is None


def test_gravity_error_is_the_angle_whatever_the_lengths():
    angle = np.radians(0.5)
    truth = track(np.tile([0.0, 0.0, -9.81], (50, 1)))
    estimate = track(np.tile([0.0, -9.0 * np.sin(angle), -9.0 * np.cos(angle)], (50, 1)))
    assert run_figures.gravity_error(truth, estimate, 0.0, 1.0) == pytest.approx(angle, rel=1e-6)


def test_rate_counts_intervals():
    assert run_figures.rate(0.01 * np.arange(101)) == pytest.approx(100.0)
    assert run_figures.rate(np.array([1.0])) is None


def test_a_share_counts_the_samples_of_its_time_alone():
    flags = Track(1)
    for stamp, flag in ((0.0, 1.0), (1.0, 1.0), (2.0, 0.0), (3.0, 1.0), (4.0, 0.0), (5.0, 0.0)):
        flags.add(stamp, flag)
    assert run_figures.share(flags, 1.0, 5.0) == pytest.approx(50.0)
    assert run_figures.share(flags, 6.0, 9.0) is None
