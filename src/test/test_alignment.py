"""The inclination after missing samples, and after a start, in fast motion: it returns within seconds and says how sure it is."""

import math
from dataclasses import replace

import numpy as np
import pytest

from gravcomp.bench.simulated_streams import KINDS, simulated
from gravcomp.orientation import EstimatorOptions, GravityEstimator, Problem
from gravcomp.orientation import quaternion as quat
from gravcomp.orientation.alignment import Alignment, Earlier
from gravcomp.recordings.imu import read_recording
from gravcomp.recordings.imu.broad_folder import WHERE, broad_files

SHAKEN = replace(KINDS["phone"], turning=2.5, turning_hz=1.2, speed=0.7, speed_hz=2.5, pauses=False)

WIDE = replace(KINDS["phone"], turning=0.4, turning_hz=0.4, speed=1.2, speed_hz=0.35, pauses=False, first_rest=0.0)

ARM = replace(KINDS["arm at 2 m/s^2"], rate=100.0, first_rest=2.0, pauses=False)


def rows(recording, index):
    names = ("stamp_ns", "gyro", "accel", "orientation", "movement")
    return replace(recording, **{name: getattr(recording, name)[index] for name in names})


def errors(recording, options=None):
    """Return error and standard deviation of the inclination in deg, and problem, of each sample."""
    estimator, found = GravityEstimator(options), []
    for sample, true in zip(recording.samples(), recording.orientation.tolist()):
        estimate = estimator.update(*sample)
        assert not isinstance(estimate, Problem)
        x, y, z = quat.rotate(true, [-g for g in estimate.imu.gravity])
        found.append((math.atan2(math.hypot(x, y), z), estimate.imu.inclination_std, estimate.imu.problem))
    error, std, problem = zip(*found)
    return np.degrees(error), np.degrees(std), list(problem)


def check_after(recording, begin, gap, longest):
    """Assert that the inclination returns after `gap` s without samples from `begin` on, and that its uncertainty holds."""
    index = np.r_[0:begin, begin + round(gap * recording.rate) : begin + round((gap + longest) * recording.rate)]
    error, std, problem = errors(rows(recording, index))
    assert problem[begin] is Problem.NONE
    assert error[begin + round(2.0 * recording.rate) :].max() < 4.0
    assert (error < 3.0 * std + 1.0)[begin:].all()


@pytest.mark.parametrize(("gap", "seed"), [(0.3, 1), (0.8, 2)])
def test_after_a_gap_in_fast_motion_the_inclination_returns_and_its_uncertainty_holds(gap, seed):
    check_after(simulated(SHAKEN, seed, 16.0), round((9.0 + 0.37 * seed) * 100.0), gap, 4.0)


@pytest.mark.parametrize(("after", "gap"), [(8.0, 0.5), (13.0, 0.4), (46.0, 0.5)])
def test_after_a_gap_in_the_fast_translation_of_a_recording_as_well(after, gap):
    files = [file for file in broad_files() if file.stem == "16_undisturbed_fast_translation_B"]
    if not files:
        pytest.skip(f"the BROAD trial 16 is missing. {WHERE}")
    recording = read_recording(files[0]).averaged(3)
    moves = int(np.argmax(recording.movement)) + round(after * recording.rate)
    part = rows(recording, slice(moves - round(8.0 * recording.rate), moves + round(8.0 * recording.rate)))
    check_after(part, round(8.0 * recording.rate), gap, 4.0)


@pytest.mark.parametrize("seed", [4, 5])
def test_a_start_in_fast_motion_is_aligned_within_two_seconds(seed):
    moving = simulated(replace(SHAKEN, first_rest=0.0), seed, 4.0)
    error, std, _ = errors(moving)
    assert error[round(2.5 * moving.rate) :].max() < 4.0
    assert (error < 3.0 * std + 1.0)[round(0.5 * moving.rate) :].all()


@pytest.mark.parametrize("seed", [100, 102])
def test_a_start_in_motion_that_is_slower_than_seconds_goes_on_until_the_vertical_shows(seed):
    moving = simulated(WIDE, seed, 6.0)
    error, std, _ = errors(moving)
    assert error[round(4.5 * moving.rate) :].max() < 6.0
    assert (error < 3.0 * std + 1.0)[round(2.5 * moving.rate) :].all()


def test_samples_beyond_the_range_of_the_accelerometer_do_not_keep_the_inclination_from_being_found():
    moving = simulated(replace(SHAKEN, first_rest=0.0), 4, 5.0)
    options, largest = EstimatorOptions(), 20.0
    options = replace(options, filter=replace(options.filter, sensor=replace(options.filter.sensor, accel_range=largest)))
    clipped = replace(moving, accel=np.clip(moving.accel, -largest, largest))
    assert (np.abs(moving.accel) > largest).any(axis=1).mean() > 0.02
    error, std, _ = errors(clipped, options)
    assert error[round(3.0 * moving.rate) :].max() < 6.0
    assert (error < 3.0 * std + 1.0)[round(0.5 * moving.rate) :].all()


def test_a_short_gap_in_slow_motion_is_bridged():
    clean = simulated(KINDS["hand, slow"], 1, 12.0)
    index = np.r_[0:600, 615 : len(clean)]
    error, _, problem = errors(rows(clean, index))
    assert set(problem) == {Problem.NONE} and error[600:].max() < 2.0


def test_a_gap_of_an_arm_is_bridged_because_its_rates_change_slowly():
    moving = simulated(ARM, 200, 8.0)
    error, _, problem = errors(rows(moving, np.r_[0:600, 630 : len(moving)]))
    assert set(problem) == {Problem.NONE} and error[600:615].max() < 2.0


@pytest.mark.parametrize(("name", "seed", "largest_deg"), [("phone", 1, 14.0), ("arm at 2 m/s^2", 3, 4.5), ("drone", 1, 4.0)])
def test_after_a_bridged_gap_the_error_is_that_of_the_standard_deviation(name, seed, largest_deg):
    """From the first sample on, with motion that is faster than the filter assumes, and with vibration."""
    moving = simulated(KINDS[name], seed, 12.0)
    begin = round(7.0 * moving.rate)
    error, std, problem = errors(rows(moving, np.r_[0:begin, begin + round(0.3 * moving.rate) : len(moving)]))
    assert set(problem) == {Problem.NONE}
    assert (error < 2.0 * std)[begin:].all() and error[begin:].max() < largest_deg
    assert std[begin:].max() < 20.0  # it is no restart: that of one says up to 90 deg


@pytest.mark.parametrize(("gap", "largest_deg"), [(0.5, 3.0), (0.7, 8.0)])
def test_a_gap_of_an_arm_is_held_by_its_rates_and_corrected_by_the_specific_force(gap, largest_deg):
    """The specific force alone is wrong by 9 deg RMS at once, because the arm accelerates by 2 m/s^2."""
    at_once = []
    for seed in (203, 204, 205):
        moving = simulated(ARM, seed, 8.0)
        error, std, problem = errors(rows(moving, np.r_[0:600, 600 + round(100.0 * gap) : len(moving)]))
        assert set(problem) == {Problem.NONE} and (error < 2.8 * std)[600:].all()
        at_once.append(error[600])
    assert math.sqrt(np.mean(np.square(at_once))) < largest_deg


def test_after_more_than_the_largest_gap_the_inclination_is_that_of_a_start():
    still = simulated(replace(SHAKEN, turning=0.0, speed=0.0), 1, 6.0)
    largest = round(EstimatorOptions().filter.sensor.largest_gap * still.rate)
    for missing, found in ((largest - 2, Problem.NONE), (largest + 1, Problem.GAP)):
        _, std, problem = errors(rows(still, np.r_[0:300, 300 + missing : 500]))
        assert problem[300] is found
        assert (std[300] < 1.0) == (found is Problem.NONE)  # a sensor at rest has not turned


@pytest.mark.parametrize(("std_deg", "share"), [(0.1, 1.0), (5.0, 0.5), (20.0, 0.0)])
def test_an_earlier_inclination_counts_by_its_variance_and_one_that_tells_nothing_not_at_all(std_deg, share):
    earlier = Earlier((0.0, 0.0, 1.0), math.radians(std_deg) ** 2, 0.0)
    force = (9.81 * math.sin(0.1), 0.0, 9.81 * math.cos(0.1))
    alignment, alone = Alignment(), Alignment()
    alignment.begin(force, 9.81, earlier)
    alone.begin(force, 9.81)
    (x, _, z), std = alignment.inclination(9.81)
    assert math.atan2(x, z) == pytest.approx(0.1 * (1.0 - share), abs=0.01)
    assert std < alone.inclination(9.81)[1] or share == 0.0


def test_the_filter_goes_on_from_the_alignment_without_a_new_error():
    moving = simulated(ARM, 203, 13.2)
    error, _, problem = errors(rows(moving, np.r_[0:600, 670 : len(moving)]))
    assert set(problem) == {Problem.NONE}
    assert error[1085:1115].max() < 1.5


def test_at_rest_the_inclination_is_sure_after_a_second():
    still = simulated(replace(SHAKEN, turning=0.0, speed=0.0), 1, 3.0)
    error, std, _ = errors(still)
    assert error[100:].max() < 0.6 and std[100] < 3.0
