"""The checks of a stream on sensors and motions that are not BROAD's: simulated ones. A clean recording has no finding."""

import functools
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gravcomp.bench.simulated_streams import KINDS, simulated
from gravcomp.bench.stream_faults import FAULTS
from gravcomp.orientation import estimate_recording
from gravcomp.orientation.inclination import inclination_rmse
from gravcomp.orientation.self_calibration import calibrate_from_itself
from gravcomp.standard_gravity import STANDARD_GRAVITY
from gravcomp.stream_checks import check_recording
from gravcomp.stream_checks.whole import looked_at


@functools.cache
def recording(name, seed=1, duration=40.0):
    return simulated(KINDS[name], seed, duration)


def kinds(found):
    return [finding.kind for finding in found]


@pytest.mark.parametrize("name", KINDS)
def test_a_clean_recording_has_no_finding_and_nothing_is_left_open(name):
    found, unknown = looked_at(recording(name, duration=26.0 if name == "1000 Hz" else 40.0))
    assert kinds(found) == [] and unknown == []


@pytest.mark.parametrize(
    ("name", "fault"),
    [
        ("hand, no rest", "rate_halved"),
        ("hand, no rest", "rate_doubled"),
        ("hand, no rest", "gyro_in_deg_s"),
        ("25 Hz", "rate_doubled"),
        ("25 Hz", "time_back"),
        ("1000 Hz", "accel_in_g"),
        ("1000 Hz", "scale_and_offset"),
        ("drone", "accel_spikes"),
        ("12 bit", "stuck"),
        ("12 bit", "gyro_in_deg_s"),
        ("12 bit", "accel_spikes"),
        ("phone", "other_frame"),
        ("phone", "quantised"),
        ("on its side", "left_handed"),
        ("arm at 2 m/s^2", "gaps"),
    ],
)
def test_a_fault_is_found_and_nothing_else(name, fault):
    faulty = FAULTS[fault].apply(recording(name, duration=26.0 if name == "1000 Hz" else 40.0), np.random.default_rng(1))
    found = kinds(check_recording(faulty))
    assert set(found) & set(FAULTS[fault].kinds) and len(found) == 1


def test_a_drift_is_found_in_nine_seconds_of_rest():
    clean = recording("arm at 2 m/s^2", seed=31, duration=60.0)
    assert kinds(check_recording(clean)) == []
    assert kinds(check_recording(FAULTS["bias_drift"].apply(clean, np.random.default_rng(1)))) == ["bias_drift"]


def test_spikes_of_the_specific_force_are_found_in_vibration_and_its_noise_is_in_the_standard_deviation():
    clean = recording("drone", seed=4, duration=15.0)
    spiky = FAULTS["accel_spikes"].apply(clean, np.random.default_rng(4))
    found = [estimate_recording(each) for each in (clean, spiky)]
    without, held = (inclination_rmse(each.orientation, clean.orientation, clean.movement) for each in found)
    assert held < without + np.radians(FAULTS["accel_spikes"].excess_deg)
    assert without < 1.5 * np.sqrt(np.mean(found[0].inclination_std[clean.movement] ** 2))


@pytest.mark.parametrize("bits", [8, 12, 16])
def test_a_smooth_maximum_of_a_coarse_sensor_is_not_clipped(bits):
    step = np.radians(2000.0) / 2 ** (bits - 1)
    clean = recording("phone", duration=20.0)
    coarse = replace(clean, gyro=np.rint(clean.gyro / step) * step)
    assert kinds(check_recording(coarse)) == (["gyro_quantised"] if bits == 8 else [])


def test_a_sensor_that_does_not_turn_leaves_axes_and_sample_rate_open():
    rest = replace(KINDS["hand, slow"], turning=0.0, speed=0.0, shaking=(0.0, 0.0))
    found, unknown = looked_at(simulated(rest, 1, 40.0))
    assert kinds(found) == [] and len(unknown) == 2 and "sample rate" in unknown[1]


def test_fast_translation_alone_is_no_unit():
    clean = recording("arm at 2 m/s^2", duration=20.0)
    shaken = replace(clean, accel=clean.accel + 12.0 * np.sin(2.0 * np.pi * 1.3 * np.arange(len(clean)) / clean.rate)[:, None])
    assert "accel_unit" not in kinds(check_recording(shaken))


@pytest.mark.parametrize("name", ["hand, no rest", "arm at 2 m/s^2", "phone"])
def test_the_acceleration_without_gravity_is_not_taken_for_another_unit(name):
    clean = recording(name)
    gravity = Rotation.from_quat(clean.orientation, scalar_first=True).inv().apply([0.0, 0.0, STANDARD_GRAVITY])
    found = check_recording(replace(clean, accel=clean.accel - gravity, orientation=None))
    assert found[0].kind == "no_gravity" and found[0].fatal and not found[0].convertible


@pytest.mark.parametrize("factor", [1.0 / STANDARD_GRAVITY, 1000.0 / STANDARD_GRAVITY, 100.0])
def test_the_unit_of_the_specific_force_is_found_without_a_rest(factor):
    clean = recording("hand, no rest")
    found = check_recording(replace(clean, accel=clean.accel * factor))
    assert kinds(found) == ["accel_unit"] and found[0].accel_factor == pytest.approx(1.0 / factor)


def test_what_a_calibration_leaves_open_is_said():
    tilted = replace(KINDS["arm at 2 m/s^2"], turning=0.03, accel_offset=0.0)
    clean = simulated(tilted, 2, 40.0)
    correction, left_open = calibrate_from_itself(replace(clean, accel=1.03 * clean.accel + 0.2))
    rest = (clean.accel[:200].mean(axis=0) * 1.03 + 0.2 - correction.accel_offset) * correction.accel_scale
    assert "turns too little" in left_open and abs(np.linalg.norm(rest) - STANDARD_GRAVITY) < 0.02
