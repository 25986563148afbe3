"""Figures of a run: sag, errors to the target, agreement of the model, error of gravity, rates."""

import numpy as np
import pytest

from gravcomp.evaluation import run_figures
from gravcomp.evaluation.overload import overload
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


def test_lateral_errors_are_told_apart_at_rest_and_while_the_base_turns():
    angle = np.radians(np.concatenate([np.zeros(300), np.linspace(0.0, 60.0, 200), np.full(300, 60.0)]))
    gravity = track(9.81 * np.column_stack([-np.cos(angle), 0.0 * angle, np.sin(angle)]))
    offset = np.where((np.arange(800) >= 300) & (np.arange(800) < 500), 4e-3, 1e-3)
    tips = track(STRAIGHT + offset[:, None] * [1.0, 0.0, 0.0])
    held, moving = run_figures.held_and_moving(tips, gravity, STRAIGHT, UP, 0.0, 8.0)
    assert held == pytest.approx(1e-3, rel=0.05) and moving == pytest.approx(4e-3, rel=0.05)
    held, moving = run_figures.held_and_moving(tips, gravity, STRAIGHT, UP, 0.0, 2.5)
    assert held == pytest.approx(1e-3) and moving is None


def test_the_settling_time_ends_where_the_lateral_error_stays():
    lateral = np.concatenate([np.linspace(0.04, 1e-3, 200), np.full(400, 1e-3)])
    tips = track(STRAIGHT + lateral[:, None] * [0.0, 1.0, 0.0])
    # A twentieth of 40 mm: the error is within 2 mm of its last value from 3 mm on.
    assert run_figures.settled(tips, STRAIGHT, UP, 0.0, 6.0, 0.04) == pytest.approx(2.0 * 37.0 / 39.0, abs=0.02)
    assert run_figures.settled(tips, STRAIGHT, UP, 7.0, 9.0, 0.04) is None


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


@pytest.mark.parametrize(
    ("rates", "delay", "words"),
    [
        ((100.0, 60.4), 0.004, ["commands came at 60 Hz in place of 100"]),
        ((80.0, 80.0), 0.031, ["IMU samples came at 80 Hz", "commands came at 80 Hz", "later than 31 ms"]),
        ((100.0, 99.0), 0.012, ["later than 12 ms, and samples come every 10 ms"]),
        ((70.0, None), None, ["IMU samples came at 70 Hz"]),
    ],
)
def test_a_machine_that_does_not_keep_up_is_named_with_rate_and_delay(rates, delay, words):
    found = overload(*rates, delay)
    assert all(word in found for word in [*words, "overloaded machine"]) and found.count("; ") == len(words)


@pytest.mark.parametrize(("rates", "delay"), [((100.0, 98.0), 0.004), ((99.7, None), None), ((None, None), None)])
def test_a_machine_that_keeps_up_is_not_blamed(rates, delay):
    assert overload(*rates, delay) is None
