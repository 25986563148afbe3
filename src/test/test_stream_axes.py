"""Which axes, signs and unit the rates of a stream have."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gravcomp.stream_checks.axes import _FACTORS, CANDIDATES, SCALES, WINDOWS, _mean_parts, _scatter_of_candidates


def test_the_scatter_of_each_candidate_is_that_of_its_own_rates():
    """It is computed from the turns by the rates and by their negatives; here by the candidate's turns, one after the other."""
    chance = np.random.default_rng(1)
    steps = 12 * WINDOWS
    turns, force = 0.1 * chance.standard_normal((steps, 3)), chance.standard_normal((steps, 3))
    orientations = np.stack([orientations_by(factor * turns) for factor in _FACTORS], axis=1)
    found = _scatter_of_candidates(_mean_parts(orientations, force))
    assert len(found) == len(CANDIDATES)
    for (matrix, scale), value in zip(CANDIDATES, found):
        turned = np.einsum("mij,mj->mi", orientations_by(SCALES[scale] * turns @ matrix.T), force)
        means = turned.reshape(WINDOWS, -1, 3).mean(axis=1)
        assert value == pytest.approx(np.mean(np.sum((means - means.mean(axis=0)) ** 2, axis=1)), rel=1e-9)


def orientations_by(turns: np.ndarray) -> np.ndarray:
    """Return the orientations (m, 3, 3) after each of the turns (m, 3)."""
    orientations, now = [], np.eye(3)
    for turn in Rotation.from_rotvec(turns).as_matrix():
        now = now @ turn
        orientations.append(now)
    return np.array(orientations)
