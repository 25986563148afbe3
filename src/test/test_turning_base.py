"""The loop's residuals while the base turns and rests: orientations, shares, and what the demo counts as rest and motion."""

import numpy as np
import pytest

from gravcomp.evaluation import run_figures
from gravcomp.evaluation.track import Track
from gravcomp.trials import turning_base
from gravcomp.virtual.motion import WaypointMotion, base_orientation

STRAIGHT, UP = np.array([0.0, 0.0, 0.1]), np.array([0.0, 0.0, 1.0])


def test_the_orientations_cover_the_sphere_of_gravity_and_repeat():
    found = turning_base.orientations(200, seed=4)
    gravity = np.array([one.T @ -UP for one in found])
    assert np.abs(gravity[5:].mean(axis=0)).max() < 0.15
    assert (gravity[5:] ** 2).mean(axis=0) == pytest.approx(np.full(3, 1 / 3), abs=0.06)
    assert np.array_equal(found, turning_base.orientations(200, seed=4))
    assert np.degrees(np.arcsin(-gravity[:5, 2])) == pytest.approx([45.0, 90.0, 45.0, 0.0, -45.0], abs=1e-6)


def test_a_motion_says_when_it_rests():
    motion = WaypointMotion([(base_orientation(0.0), 2.0), (base_orientation(0.5), 1.0), (base_orientation(0.5), 1.0)], rate=0.25)
    assert np.array(motion.rests) == pytest.approx(np.array([[0.0, 2.0], [4.0, 5.0], [5.0, 6.0]]))


def test_errors_at_rest_and_in_motion_are_counted_apart():
    """The base turns from 5 to 7 s; the tip is 1 mm off until then, 4 mm in the turn and 2 mm after it."""
    tip, gravity = Track(3), Track(3)
    for time in np.arange(0.0, 12.0, 0.02):
        angle = 0.5 * np.clip(time - 5.0, 0.0, 2.0)
        gravity.add(time, 9.81 * np.sin(angle), 0.0, -9.81 * np.cos(angle))
        off = 1e-3 if time < 5.0 else 4e-3 if time < 7.5 else 2e-3
        tip.add(time, off, 0.0, 0.098)
    held, moving = run_figures.held_and_moving(tip, gravity, STRAIGHT, UP, 2.0, 12.0)
    assert moving == pytest.approx(4e-3)
    assert held == pytest.approx(np.sqrt((3.0 * 1.0 + 4.0 * 4.0) / 7.0) * 1e-3, rel=0.03)  # counted again 1 s after the turn
    assert run_figures.held_and_moving(tip, gravity, STRAIGHT, UP, 20.0, 30.0) == (None, None)


def test_settling_is_counted_in_shares_of_the_sag():
    tip = Track(3)
    for time in np.arange(0.0, 6.0, 0.01):
        tip.add(time, 0.03 * np.exp(-max(time - 1.0, 0.0) / 0.3), 0.0, 0.1)
    assert run_figures.settled(tip, STRAIGHT, UP, 1.0, 6.0, 0.03) == pytest.approx(0.3 * np.log(20.0), abs=0.02)
    assert run_figures.settled(tip, STRAIGHT, UP, 8.0, 9.0, 0.03) is None
