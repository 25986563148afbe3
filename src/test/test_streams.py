"""Faults of IMU streams on real recordings: each is reported, and held where it can be. A clean recording has no finding."""

import functools
import math
from dataclasses import replace

import numpy as np
import pytest

from gravcomp.bench.stream_faults import FAULTS
from gravcomp.bench.streams import outcome
from gravcomp.orientation import estimate_recording
from gravcomp.orientation.even_steps import EvenSteps
from gravcomp.orientation.inclination import inclination_rmse
from gravcomp.orientation.offline import without_rate_spikes
from gravcomp.orientation.spike_review import AHEAD, SURE_GYRO, SpikeReview
from gravcomp.orientation.spikes import SpikeGate, SpikeOptions
from gravcomp.recordings.imu import Recording, RecordingError, read_recording
from gravcomp.recordings.imu.broad_folder import WHERE, broad_files
from gravcomp.stream_checks import CounterStamps, StreamMonitor, check_recording, in_si
from gravcomp.stream_checks.spikes import spikes as found_spikes

TRIAL = "05_undisturbed_slow_rotation_with_breaks_B"
LENGTH = 25.0  # s of motion


def shortened(recording):
    begin = int(np.argmax(recording.movement)) - int(8.0 * recording.rate)
    part = slice(max(0, begin), begin + int((8.0 + LENGTH) * recording.rate))
    rows = {name: getattr(recording, name)[part] for name in ("stamp_ns", "gyro", "accel", "orientation", "movement")}
    return replace(recording, **rows)


@functools.cache
def averaged_trial(stem):
    files = {file.stem: file for file in broad_files()}
    if stem not in files:
        pytest.skip(f"the BROAD trial {stem} is missing. {WHERE}")
    return read_recording(files[stem]).averaged(3)


@pytest.fixture(scope="module")
def trial():
    return averaged_trial(TRIAL)


@pytest.fixture(scope="module")
def short(trial):
    return shortened(trial)


@pytest.fixture(scope="module")
def clean_deg(short):
    return math.degrees(inclination_rmse(estimate_recording(short).orientation, short.orientation, short.movement))


def test_a_clean_recording_has_no_finding(trial):
    assert check_recording(trial) == []


@pytest.mark.parametrize("fault", [None, "gyro_spikes"])
@pytest.mark.parametrize(("begin", "end"), [(0.25, 0.45), (0.45, 0.65), (0.65, 0.85), (0.0, 1.0)])
@pytest.mark.parametrize("stem", ["12_undisturbed_slow_translation_C", "27_disturbed_phone_vibration_B"])
def test_a_stream_that_hardly_turns_keeps_its_unit_with_spikes_and_without_rest(stem, begin, end, fault):
    recording = averaged_trial(stem)
    part = slice(int(begin * len(recording)), int(end * len(recording)))
    if fault is not None:
        recording = FAULTS[fault].apply(recording, np.random.default_rng(3))
    monitor = StreamMonitor()
    for block in np.array_split(np.arange(len(recording))[part], max(1, (part.stop - part.start) // 256)):
        monitor.add_block(recording.stamp_ns[block], recording.gyro[block], recording.accel[block])
    assert [finding.kind for finding in monitor.findings()] == ([] if fault is None else [fault])


@pytest.mark.parametrize("unit", ["gyro_in_deg_s", "gyro_in_millideg_s"])
@pytest.mark.parametrize("stem", ["12_undisturbed_slow_translation_C", "27_disturbed_phone_vibration_B"])
def test_the_unit_of_rates_is_known_apart_from_their_bias_where_the_sensor_hardly_turns(stem, unit):
    recording = averaged_trial(stem)
    (finding,) = check_recording(FAULTS[unit].apply(recording, np.random.default_rng(3)))
    assert finding.kind == "gyro_unit"
    assert finding.text.startswith(f"the gyroscope is in {unit.removeprefix('gyro_in_').replace('_s', '/s')}:")


@pytest.mark.slow
@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_reported_and_held(name, trial, short, clean_deg):
    fault = FAULTS[name]
    # The drift needs the rest at the end, a calibration all turns; the others are shown by any part with motion.
    kinds, error = outcome(fault, trial if name in ("bias_drift", "scale_and_offset") else short, seed=2)
    assert set(kinds) & set(fault.kinds) and "left_open" not in kinds
    if error is not None:
        assert error <= clean_deg + fault.excess_deg


def test_a_wrong_rate_is_found_where_the_likeliest_scale_is_not_quite_2():
    recording = averaged_trial("27_disturbed_phone_vibration_B")
    (finding,) = check_recording(FAULTS["rate_doubled"].apply(recording, np.random.default_rng(1)))
    assert finding.kind == "rate" and "are half those" in finding.text


def test_a_wrong_unit_is_refused_unless_it_is_to_be_converted(short):
    in_g = replace(short, accel=short.accel / 9.80665)
    with pytest.raises(RecordingError, match=r"in g .* --units auto"):
        in_si(in_g, convert=False, option="--units auto")
    recording, findings, _ = in_si(in_g, convert=True)
    np.testing.assert_allclose(recording.accel, short.accel)
    assert [finding.kind for finding in findings] == ["accel_unit"]


def test_the_live_checks_find_what_the_offline_checks_find(short):
    faulty = FAULTS["gyro_spikes"].apply(short, np.random.default_rng(1))
    monitor = StreamMonitor(memory=120.0)
    for sample in faulty.samples():
        monitor.add(*sample)
    assert [finding.kind for finding in monitor.findings()] == ["gyro_spikes"]


def test_a_live_stream_forgets_that_its_time_went_back():
    monitor, stamps = StreamMonitor(memory=1.0), 10_000_000 * np.arange(2560)
    stamps[[100, 101]] = stamps[[101, 100]]
    still = np.tile([0.0, 0.0, 9.81], (256, 1))
    found = []
    for block in stamps.reshape(10, 256):
        monitor.add_block(block, 0.0 * still, still)
        found.append("time_back" in [finding.kind for finding in monitor.findings()])
    assert found[0] and not found[-1]


def gated(values):
    """Return what a gate counts of a signal of one axis in the end, and how many spikes it held."""
    gate = SpikeGate(math.radians(20.0), SpikeOptions(), 1.0)
    counted = []
    for value in values:
        used, right = gate.take(0.01, (value, 0.0, 0.0))
        if right:
            counted[-len(right) :] = [x for x, _, _ in right]
        counted.append(used[0])
    return np.array(counted), gate.count


@pytest.mark.parametrize("spikes", [{60: 7.0}, {60: 7.0, 61: -5.0}, {60: -3.0, 90: 4.0}])
def test_spikes_are_replaced_by_the_straight_line(spikes):
    signal = np.sin(0.1 * np.arange(200))
    spiky = signal.copy()
    for place, value in spikes.items():
        spiky[place] += value
    counted, count = gated(spiky)
    assert count == len(spikes) and np.abs(counted - signal).max() < 0.03


def test_a_jump_that_stays_counts_in_full():
    signal = np.where(np.arange(200) < 100, 0.0, 5.0)
    counted, count = gated(signal)
    assert count == 0 and (counted == signal).all()


def test_fast_motion_is_not_taken_for_spikes():
    signal = 10.0 * np.sin(2.0 * np.pi * 8.0 * 0.01 * np.arange(400))  # 8 Hz, 570 deg/s, at 100 Hz
    counted, count = gated(signal)
    assert count == 0 and (counted[20:] == signal[20:]).all()


def reviewed(values):
    """Return what a review counts of rates (n, 3) in rad/s at 95 Hz."""
    review, counted = SpikeReview(math.radians(20.0), SpikeOptions(), SURE_GYRO), np.array(values)
    for i, value in enumerate(values.tolist()):
        decided = review.take(0.0105, tuple(value))
        if decided is not None:
            counted[i - AHEAD] = decided
    return counted


@pytest.mark.parametrize("all_axes", [True, False])
def test_spikes_are_found_in_motion_that_changes_as_fast_as_they_do(all_axes):
    time = 0.0105 * np.arange(600)[:, None]
    signal = 5.0 * np.sin(2.0 * np.pi * 4.0 * time + np.arange(3.0))  # 4 Hz, 290 deg/s: 60 deg/s from sample to sample
    random = np.random.default_rng(4)
    hit = random.random((600, 1)) < 0.02 if all_axes else np.arange(600)[:, None] % 40 == np.array([5, 15, 25])
    spiky = signal + hit * random.choice([-1.0, 1.0], (600, 3)) * random.uniform(1.5, 7.0, (600, 3))
    assert (reviewed(signal) == signal).all()
    assert np.abs(reviewed(spiky) - signal).max() < 0.35  # 20 deg/s


def test_spikes_are_found_in_vibration_which_no_curve_follows():
    random = np.random.default_rng(3)
    signal = 0.2 * np.sin(np.arange(2000)[:, None] * [2.9, 2.7, 2.5])  # 11 deg/s, at 0.46 to 0.4 of the sample rate
    hit = random.random((2000, 1)) < 0.02
    spiky = signal + hit * random.choice([-1.0, 1.0], (2000, 3)) * random.uniform(2.2, 4.0, (2000, 3))
    settled = slice(100, -AHEAD)
    assert (reviewed(signal)[settled] == signal[settled]).all()
    assert np.abs(reviewed(spiky) - signal)[settled].max() < 1.0


@pytest.mark.parametrize("hz", [1.0, 3.0, 4.0, 5.0])
def test_motion_that_begins_after_a_rest_is_no_spike(hz):
    time = 0.0105 * np.arange(-150, 300)[:, None]
    signal = np.where(time > 0.0, 5.0 * np.sin(2.0 * np.pi * hz * time) * np.array([1.0, -0.5, 0.8]), 0.0)  # 290 deg/s
    assert (reviewed(signal) == signal).all()


@pytest.mark.parametrize("places", [(0,), (0, 1, 3), (0, 2, 3), (0, 1, 2)])
def test_as_many_as_three_spikes_in_slow_motion_leave_nothing(places):
    signal = 0.3 * np.sin(0.03 * np.arange(300)[:, None] + np.arange(3.0))
    spiky = signal.copy()
    spiky[[150 + place for place in places]] += [0.14, 4.0, -3.0]  # the part of 8 deg/s alone would end a rest
    assert np.abs(reviewed(spiky) - signal).max() < math.radians(1.5)


@pytest.mark.parametrize(("floor_deg_s", "removed"), [(20.0, True), (2000.0, False)])
def test_means_of_samples_are_made_without_spikes_of_the_rate(floor_deg_s, removed):
    time, place = np.arange(400) / 100.0, 201
    gyro = np.sin(2.0 * np.pi * time)[:, None] * [1.0, 0.5, -0.7]
    spiky = gyro.copy()
    spiky[place] += [5.0, 0.0, -6.0]
    recording = Recording("made", np.rint(1e9 * time).astype(np.int64), spiky, np.tile([0.0, 0.0, 9.81], (400, 1)))
    means = without_rate_spikes(recording, SpikeOptions(gyro=np.radians(floor_deg_s))).averaged(2).gyro
    off = np.abs(means - 0.5 * (gyro[::2] + gyro[1::2])).max(axis=1)
    assert (off[place // 2] < 0.02) == removed and np.delete(off, place // 2).max() < 1e-9


def counted(stamps):
    """Return the steps that count for stamps in s."""
    even = EvenSteps()
    return np.array([even.take(dt) for dt in np.diff(stamps).tolist()])


@pytest.mark.parametrize("lost", [(), (500, 700, 701)])
def test_stamps_that_jitter_are_evened_out_and_keep_their_time(lost):
    taken = 0.01 * np.delete(np.arange(1000), lost)
    stamps = taken + np.random.default_rng(5).uniform(-0.003, 0.003, len(taken))
    steps = counted(stamps)
    settled = slice(200, None)
    assert np.std((steps - np.diff(taken))[settled]) < 0.25 * np.std((np.diff(stamps) - np.diff(taken))[settled])
    assert np.abs(np.cumsum(steps) - (taken[1:] - taken[0])).max() < 0.008


def jittered(rng, count, period):
    return period * (np.arange(count) + rng.uniform(-0.3, 0.3, count))


@pytest.mark.parametrize("change", [(0.01, 0.005), (0.005, 0.01), (0.01, 0.002)])
def test_steps_are_evened_after_a_change_of_the_rate_and_the_time_stays_that_of_the_stamps(change):
    rng = np.random.default_rng(7)
    first, second = (jittered(rng, 1500, period) for period in change)
    stamps = np.concatenate([first, first[-1] + max(change) + second])
    steps = counted(stamps)
    assert (steps > 0.0).all() and np.abs(np.cumsum(steps) - (stamps[1:] - stamps[0])).max() < 0.8 * max(change)
    assert np.std(steps[2000:]) < 0.5 * np.std(np.diff(stamps)[2000:])


def test_a_short_first_step_is_not_taken_for_the_period_for_ever():
    stamps = np.concatenate([[0.0, 0.001], 0.011 + jittered(np.random.default_rng(8), 1000, 0.01)])
    assert np.std(counted(stamps)[300:]) < 0.5 * np.std(np.diff(stamps)[300:])


def test_stamps_without_jitter_count_as_they_are():
    stamps = np.cumsum(0.01 + 0.0002 * np.sin(np.arange(500.0)) + 0.04 * (np.arange(500) % 97 == 0))  # with samples lost
    np.testing.assert_allclose(counted(stamps), np.diff(stamps), rtol=1e-12)


@pytest.mark.parametrize("share", [0.0, 0.02, 0.1, 0.2])
def test_the_share_of_spikes_is_found_also_where_they_are_many(share):
    rng = np.random.default_rng(11)
    time = np.arange(2560)[:, None] / 95.2
    signal = np.sin(2.0 * np.pi * 1.5 * time + [0.0, 1.0, 2.0]) + rng.normal(0.0, 0.01, (len(time), 3))
    hit = rng.random(len(time)) < share
    signal[hit] += rng.uniform(2.0, 7.0, (hit.sum(), 3)) * rng.choice([-1.0, 1.0], (hit.sum(), 3))
    found = np.concatenate([found_spikes(block, 0.15) for block in signal.reshape(10, 256, 3)])
    # Where many follow each other, some hide others, and a sample between two looks like one.
    assert 0.5 * hit.mean() <= found.mean() <= 1.2 * hit.mean() + 0.001
    assert found[~hit].mean() < 0.02


@pytest.mark.parametrize("frequency", [10.0, 25.0, 40.0])
@pytest.mark.parametrize("begin", [60, 128, 240])
def test_vibration_that_begins_within_a_block_is_no_row_of_spikes(frequency, begin):
    rng, k = np.random.default_rng(3), np.arange(256)
    shaken = np.where(k < begin, 0.0, np.sin(2.0 * np.pi * frequency * k / 95.2) * rng.uniform(3.0, 6.0, 256))
    signal = rng.normal(0.0, 0.01, (256, 3))
    signal[:, 1] += shaken
    assert found_spikes(signal, 0.15).sum() <= 1


def test_a_counter_that_wraps_is_continued_live():
    span, period = 2**32 * 1000, 10_000_000  # ns, of a counter of 32 bits in us
    stamps = [(span - 55 * period // 10 + k * period) % span for k in range(20)]
    counter = CounterStamps()
    continued = np.array([counter.continued(stamp) for stamp in stamps])
    assert (np.diff(continued) == period).all() and counter.wraps == 1
    # A clock that is set back is no counter.
    assert counter.continued(stamps[-1] - 5 * period) < continued[-1] and counter.wraps == 1
