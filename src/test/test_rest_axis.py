"""The axis of a robot that is bent at rest."""

import numpy as np
import pytest

from gravcomp.rest_axis import Arc, RestAxis, straightened

LENGTH = 0.2
AXIS = RestAxis((Arc(0.05, 0.6, 0.3), Arc(0.05, 0.9, 1.0), Arc(0.05, 0.2, -2.0), Arc(0.05, 1.0, 0.4)))


def test_the_curvature_is_that_of_the_frames():
    s, step = np.linspace(0.002, 0.198, 40), 1e-6
    (_, before), (_, after), (_, here) = (AXIS.frames(s + shift) for shift in (-step, step, 0.0))
    bend = np.einsum("nij,ni->nj", here, (after - before)[:, :, 2]) / (2 * step)
    assert AXIS.curvature(s) == pytest.approx(bend[:, :2], abs=1e-6)
    assert not RestAxis().curvature(s).any()


def test_points_are_straightened_in_few_steps(monkeypatch):
    """A point lies up to 5 mm from an axis whose radius is 50 mm: plain steps along the axis take 28 for it."""
    chance = np.random.default_rng(0)
    straight = np.column_stack([chance.uniform(-5e-3, 5e-3, (500, 2)), chance.uniform(0.0, LENGTH, 500)])
    points, steps, frames = AXIS.points(straight), [], RestAxis.frames
    monkeypatch.setattr(RestAxis, "frames", lambda axis, s: steps.append(1) or frames(axis, s))
    assert straightened(AXIS, points, LENGTH) == pytest.approx(straight, abs=1e-15)
    assert len(steps) <= 10
