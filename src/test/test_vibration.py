"""Noise of vibration, and what a sensor may have turned in a gap, from its samples."""

import itertools
import math

import numpy as np
import pytest

from gravcomp.orientation.last_steps import LastSteps, Step
from gravcomp.orientation.spikes import SpikeOptions
from gravcomp.orientation.swings import Swings
from gravcomp.orientation.vibration import Vibration

PERIOD = 0.01  # s


def noise_of(samples, means=3):
    vibration = Vibration(means)
    for sample in samples.tolist():
        vibration.take(PERIOD, tuple(sample))
    return vibration


def test_the_density_of_white_noise_is_its_variance_times_the_period():
    vibration = noise_of(np.random.default_rng(1).normal(0.0, 2.0, (2000, 3)))
    assert vibration.variance(PERIOD) == pytest.approx(4.0, rel=0.3)
    assert vibration.density == pytest.approx(4.0 * PERIOD, rel=0.4)


def test_a_motion_has_no_noise_and_a_fast_tone_less_than_white_noise_of_its_size():
    time = PERIOD * np.arange(1000)[:, None] + np.array([0.0, 0.1, 0.2])
    assert noise_of(5.0 * np.sin(2.0 * np.pi * 1.5 * time)).density < 1e-4 * 12.5 * PERIOD
    tone = noise_of(np.sin(2.0 * np.pi * 43.0 * time))
    assert tone.variance(PERIOD) > 0.5 and tone.density < 0.05 * 0.5 * PERIOD


def test_a_gap_is_no_vibration():
    vibration = noise_of(np.zeros((100, 3)))
    vibration.interrupt()
    for _ in range(100):
        vibration.take(PERIOD, (9.0, 0.0, 0.0))
    assert vibration.density == vibration.variance(PERIOD) == 0.0


def missed(rates, gap):
    """Return what the likeliest rate in a gap of `gap` samples misses of the turn, and what Swings says; RMS over many, rad."""
    swings, said, wrong = Swings(), [], []
    for k, rate in enumerate(rates[: -gap - 1].tolist()):
        swings.watch(PERIOD, tuple(rate))
        if k > 300:
            mean, variance = swings.across(gap * PERIOD, PERIOD, tuple(rates[k + gap].tolist()), 0.0)
            wrong.append(PERIOD * np.linalg.norm(rates[k + 1 : k + gap + 1].sum(axis=0) - gap * np.array(mean)))
            said.append(math.sqrt(3.0 * variance))
    return (math.sqrt(np.mean(np.square(values))) for values in (wrong, said))


@pytest.mark.parametrize("gap", [10, 30, 60])
@pytest.mark.parametrize(("tremor", "noise"), [(0.0, 0.0), (0.1, 0.0), (0.0, 0.2)], ids=["slow", "tremor", "vibration"])
def test_what_a_gap_hides_of_a_random_motion_is_about_what_is_said(gap, tremor, noise):
    """A motion that is smoother than the one assumed turns less than is said, most so in a short gap."""
    random = np.random.default_rng(2)
    rates = random.normal(0.0, 1.0, (1500, 3))
    for _ in range(3):  # low-passes of 0.25 s
        rates = np.array(list(itertools.accumulate(rates, lambda smooth, rate: smooth + (rate - smooth) / 26.0)))
    rates /= rates.std()
    time = PERIOD * np.arange(1500)[:, None]
    rates += tremor * np.sin(2.0 * np.pi * 8.0 * time + np.array([0.0, 2.0, 4.0]))
    wrong, said = missed(rates + random.normal(0.0, noise, rates.shape), gap)
    assert 0.7 < said / wrong < 3.5


def test_of_the_force_of_a_vibrating_sensor_spikes_that_no_jump_shows_are_held_later():
    random, steps = np.random.default_rng(3), LastSteps(SpikeOptions())
    shaken = 4.0 * math.sqrt(2.0) * np.sin(np.arange(2000)[:, None] * [2.9, 2.7, 2.5])  # RMS 4 m/s^2
    hit = np.arange(2000) % 50 == 49
    spiky = shaken + hit[:, None] * random.choice([-1.0, 1.0], (2000, 3)) * random.uniform(24.0, 27.0, (2000, 3))
    taken = []
    for force in spiky.tolist():
        step = Step(0.005, (0.0, 0.0, 0.0), tuple(force), True, True)
        for _, earlier in steps.take(step, gap=False):
            steps.keep((), earlier)
        steps.keep((), step)
        taken.append(step)
    left = np.abs(np.array([step.force for step in taken]) - shaken)[hit][4:-1]
    assert (left.max(axis=1) < 10.0).all()  # the vibration that is lost with the spike
    kept = np.array([step.force for step in taken])[~hit]
    assert (kept == spiky[~hit]).all(axis=1)[200:-4].mean() > 0.99
