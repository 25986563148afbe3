"""What a recording of the silicone beam shows without a model: the free swing, the hand's turn, the slowing to the rest."""

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gravcomp.calibration.measured import MeasurementError
from gravcomp.experiments.measured.beam import Damping
from gravcomp.experiments.measured.beam_fit import COARSE, THEIRS, BareFit, hand_removed, prediction_interval, slowing
from gravcomp.experiments.measured.beam_model import resting_face
from gravcomp.experiments.measured.beam_recording import hand_turn, read, swing, turn_in_plane

FREQUENCY, DECAY, TURN, CREEP = 4.0, 2.5, 15.0, 0.01  # Hz, 1/s, rad/m, per e-fold of the time
TRAVEL, HAND = -8e-3, np.radians(3.0)
STRAIGHT = 1e-3 * np.array([[74.0, 30.6, 74.8], [62.7, 51.0, 74.8], [45.1, 9.3, 74.8]])


def turned(angle):
    """The straight markers, turned by `angle` in rad about y."""
    mean = STRAIGHT.mean(axis=0)
    return mean + Rotation.from_rotvec([0.0, angle, 0.0]).apply(STRAIGHT - mean)


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """A hand holds the face turned too far, and lets it go after 1 s; the face's turn belongs to its height."""
    path = tmp_path_factory.mktemp("beam") / "gravity_x.csv"
    names = [f"tip{i}_{axis}_mm" for i in (1, 2, 3) for axis in "xyz"]
    rows = []
    for time in np.arange(0.0, 6.0, 0.01):
        if time < 1.0:
            markers = turned(HAND)
        else:
            after = time - 1.0
            rest = TRAVEL * (1.0 + CREEP * np.log(max(after, 0.01) / 4.5))
            height = rest - TRAVEL * np.exp(-DECAY * after) * np.cos(2 * np.pi * FREQUENCY * after)
            markers = turned(TURN * height) + np.array([height, 0.0, 0.0])
        rows.append([time, *(1e3 * markers).ravel()])
    np.savetxt(path, rows, delimiter=",", header=",".join(["time_s", *names]), comments="")
    return read(path)


def test_the_swing_is_found(recording):
    free = swing(recording)
    assert free.frequency == pytest.approx(FREQUENCY, rel=2e-3)
    assert free.decay == pytest.approx(DECAY, rel=0.03)
    assert free.turn == pytest.approx(TURN, rel=1e-3)
    assert free.creep == pytest.approx(CREEP, rel=0.05)
    assert free.loss == pytest.approx(DECAY / (np.pi * FREQUENCY), rel=0.03)


def test_the_turn_of_the_hand_follows_from_the_swing_and_is_removed(recording):
    free = swing(recording)
    assert hand_turn(recording, free) == pytest.approx(HAND, abs=np.radians(0.05))
    assert turn_in_plane(STRAIGHT, hand_removed(recording, free)) == pytest.approx(0.0, abs=np.radians(0.05))


def test_the_modulus_falls_from_the_swing_to_the_rest_by_what_is_lost_between(recording):
    """The mean of both losses, (2 / pi) eta and the creep, times the e-folds of the time."""
    free = swing(recording)
    folds = np.log(2 * np.pi * FREQUENCY * recording.rest_time)
    expected = 0.5 * (2.0 / np.pi * DECAY / (np.pi * FREQUENCY) + CREEP) * folds
    assert slowing(free, recording.rest_time) == pytest.approx(expected, rel=0.03)


def test_every_swing_loses_the_same_part_and_is_as_stiff_as_measured():
    damping = Damping(loss=0.1, fast=300e3, slow=260e3, frequency=7.7)
    ratio = np.array([term.share for term in damping.prony])
    ratio = ratio / (1.0 - ratio.sum())
    times = np.array([term.time for term in damping.prony])
    for frequency in (3.0, 7.7):
        x = 2 * np.pi * frequency * times
        loss = 2 * np.pi * frequency * damping.time(frequency) + (ratio * x / (1.0 + x**2)).sum()
        assert loss * damping.slow / damping.fast == pytest.approx(0.1)
    assert 1.0 + (ratio * x**2 / (1.0 + x**2)).sum() == pytest.approx(300.0 / 260.0)


def test_a_recording_of_a_beam_that_never_falls_is_refused(tmp_path):
    path = tmp_path / "load52_x.csv"
    names = [f"tip{i}_{axis}_mm" for i in (1, 2, 3) for axis in "xyz"]
    np.savetxt(path, np.ones((50, 10)), delimiter=",", header=",".join(["time_s", *names]), comments="")
    with pytest.raises(MeasurementError, match="never fall by 2 mm"):
        read(path)
    with pytest.raises(MeasurementError, match="begins with neither gravity nor load and the grams"):
        read(tmp_path / "other.csv")


def test_what_the_bare_beam_leaves_open_widens_the_prediction_of_a_loaded_one():
    """A modulus known within 1 %, and a plate that is known or not, against the sag of a cantilever."""
    softer = np.diag([0.01**2, 0.0])
    fit = BareFit(THEIRS, THEIRS, 2e-3, np.zeros(3), [], softer)
    sag = -resting_face(THEIRS, 0.02, 2e-3, COARSE).position[0]
    assert prediction_interval(fit, 0.02, COARSE) == pytest.approx(1.96 * 0.01 * sag, rel=0.15)
    unknown = dataclasses.replace(fit, covariance=softer + np.diag([0.0, 1e-3**2]))
    one_gram = 9.81e-3 * 0.1**3 / (3 * THEIRS * 0.03**4 / 12)  # m, of a slender cantilever
    assert prediction_interval(unknown, 0.02, COARSE) == pytest.approx(1.96 * np.hypot(0.01 * sag, one_gram), rel=0.2)
    # A heavier plate on a stiffer beam sags alike: what both leave open together is less.
    together = unknown.covariance + 0.9 * 0.01 * 1e-3 * np.array([[0.0, -1.0], [-1.0, 0.0]])
    assert prediction_interval(dataclasses.replace(fit, covariance=together), 0.02, COARSE) < 1.96 * max(0.01 * sag, one_gram)
