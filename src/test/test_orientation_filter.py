"""The orientation filter: its errors at rest and in motion, and what it reports of invalid samples."""

import math

import numpy as np
import pytest

from gravcomp.orientation import FilterOptions, OrientationFilter, Problem
from gravcomp.orientation import quaternion as quat
from gravcomp.orientation.inclination import inclination_error
from gravcomp.orientation.options import SensorOptions

STEP = 10_000_000  # ns: 100 Hz
DEG = math.radians(1.0)
UP = (0.0, 0.0, 9.81)


def noisy(value, random, std):
    return tuple(np.asarray(value) + random.normal(0.0, std, 3))


def at_rest(filter_, count, *, gyro=(0.0, 0.0, 0.0), accel=UP, start=0, step=STEP, seed=1):
    random = np.random.default_rng(seed)
    for k in range(count):
        estimate = filter_.update(start + k * step, noisy(gyro, random, 0.1 * DEG), noisy(accel, random, 0.02))
    return estimate


def swinging(duration, rate, *, bias=(0.0, 0.0, 0.0), amplitude=0.5, seed=2):
    """A sensor that swings about its axes without moving: stamp, gyro, accel and true orientation of each sample."""
    random = np.random.default_rng(seed)
    fine = max(1, min(4, 400 // rate))  # steps of the ground truth for each sample
    q, samples = quat.IDENTITY, []
    for k in range(round(duration * rate)):
        turn = np.zeros(3)
        for j in range(fine):
            t = (k + (j + 0.5) / fine) / rate
            # At rest at first, so that the bias can be learned.
            w = amplitude * np.array([math.sin(2.0 * t), 0.7 * math.cos(1.3 * t), 0.3 * math.sin(0.9 * t)]) * (t > 5.0)
            turn += w / (rate * fine)
            q = quat.normalised(quat.multiply(q, quat.exponential(*(w / (rate * fine)))))
        gyro = turn * rate + bias + random.normal(0.0, 0.01 * DEG * math.sqrt(rate / 2), 3)
        accel = np.array(quat.rotate(quat.conjugate(q), UP)) + random.normal(0.0, 0.005 * math.sqrt(rate / 2), 3)
        samples.append((round((k + 1) * 1e9 / rate), gyro, accel, q))
    return samples


def options_without_delay(**changes):
    return FilterOptions(sensor=SensorOptions(delay=0.0), **changes)


def test_starts_with_the_inclination_of_the_first_sample_and_yaw_zero():
    tilted = quat.from_roll_pitch_yaw(0.4, -0.7, 0.0)
    estimate = OrientationFilter().update(0, (0, 0, 0), quat.rotate(quat.conjugate(tilted), UP))
    assert estimate.orientation == pytest.approx(tilted)
    assert estimate.gravity == pytest.approx(quat.rotate(quat.conjugate(tilted), (0, 0, -9.81)))


def test_learns_the_bias_at_rest_and_reports_the_rest():
    bias = (1.5 * DEG, -0.8 * DEG, 0.5 * DEG)
    estimate = at_rest(OrientationFilter(), 1500, gyro=bias)
    assert estimate.rest
    # Three standard deviations by the filter itself, 0.02 deg/s.
    assert estimate.bias == pytest.approx(bias, abs=3.0 * math.sqrt(estimate.covariance[4, 4]))
    assert math.sqrt(estimate.covariance[4, 4]) < 0.05 * DEG


@pytest.mark.parametrize("rate", [50, 200, 1000])
def test_one_parameter_set_serves_every_rate(rate):
    filter_ = OrientationFilter(options_without_delay())
    truth, estimated = [], []
    for stamp, gyro, accel, true in swinging(10.0, rate, bias=(0.5 * DEG, -0.5 * DEG, 0.3 * DEG)):
        estimated.append(filter_.update(stamp, gyro, accel).orientation)
        truth.append(true)
    error = inclination_error(np.array(estimated), np.array(truth))[5 * rate :]
    assert np.degrees(np.sqrt(np.mean(error**2))) < 0.15


def test_oscillating_acceleration_is_not_taken_for_tilt():
    filter_ = OrientationFilter(options_without_delay())
    at_rest(filter_, 300)
    worst, random = 0.0, np.random.default_rng(7)
    for k in range(200):
        push = 4.0 * math.sin(2.0 * math.pi * k / 50.0)  # m/s^2 at 2 Hz: 22 deg if it were gravity
        estimate = filter_.update((300 + k) * STEP, noisy((0, 0, 0), random, 0.1 * DEG), (push, 0, 9.81))
        worst = max(worst, float(inclination_error(np.array([estimate.orientation]), np.array([quat.IDENTITY]))[0]))
    assert math.degrees(worst) < 1.0


def test_a_slow_steady_tilt_is_not_taken_for_bias():
    filter_ = OrientationFilter(options_without_delay())
    at_rest(filter_, 500)
    random, angle = np.random.default_rng(3), 0.0
    for k in range(2000):
        angle += 1.0 * DEG * 0.01
        accel = (0.0, 9.81 * math.sin(angle), 9.81 * math.cos(angle))
        estimate = filter_.update((500 + k) * STEP, noisy((1.0 * DEG, 0, 0), random, 0.1 * DEG), noisy(accel, random, 0.02))
    assert abs(estimate.bias[0]) < 0.05 * DEG
    assert np.degrees(inclination_error(np.array([estimate.orientation]), np.array([quat.exponential(angle, 0, 0)])))[0] < 0.2


def test_yaw_grows_uncertain_while_the_inclination_does_not():
    filter_ = OrientationFilter()
    early = None
    for stamp, gyro, accel, _ in swinging(60.0, 50):
        estimate = filter_.update(stamp, gyro, accel)
        early = early or (estimate if stamp > 10e9 else None)
    assert estimate.covariance[2, 2] > 2.0 * early.covariance[2, 2]
    assert estimate.inclination_std < 1.5 * early.inclination_std
    assert np.linalg.eigvalsh(estimate.covariance).min() > 0.0


def test_its_own_standard_deviation_is_the_size_of_its_error():
    filter_ = OrientationFilter(options_without_delay(accel_error=0.0))
    ratio = []
    for stamp, gyro, accel, true in swinging(30.0, 100):
        estimate = filter_.update(stamp, gyro, accel)
        if stamp > 10e9:
            error = inclination_error(np.array([estimate.orientation]), np.array([true]))[0]
            ratio.append(error / estimate.inclination_std)
    # The filter allows for a scale error, which the simulated sensor does not have: the error may be smaller than reported, not
    # larger.
    assert np.sqrt(np.mean(np.square(ratio))) < 1.2


def test_an_accelerometer_that_measures_9_3_at_rest_is_compensated_and_reported():
    filter_ = OrientationFilter(options_without_delay())
    estimate = at_rest(filter_, 600, accel=(0, 0, 9.3))
    assert estimate.accel_norm_at_rest == pytest.approx(9.3, abs=0.01)
    for k in range(300):  # a turn by 90 deg in 3 s
        angle = math.radians(90.0) * (k + 1) / 300
        accel = (0.0, 9.3 * math.sin(angle), 9.3 * math.cos(angle))
        estimate = filter_.update((600 + k) * STEP, (math.radians(30.0), 0, 0), accel)
    error = inclination_error(np.array([estimate.orientation]), np.array([quat.exponential(math.pi / 2, 0, 0)]))[0]
    assert math.degrees(error) < 0.5


@pytest.mark.parametrize(
    ("gyro", "accel", "problem"),
    [
        ((math.nan, 0, 0), UP, Problem.NOT_FINITE),
        ((0, 0, 0), (0, math.inf, 0), Problem.NOT_FINITE),
        ((100.0, 0, 0), UP, Problem.OUT_OF_RANGE),
        ((0, 0, 0), (0, 0, 5000.0), Problem.OUT_OF_RANGE),
    ],
)
def test_invalid_samples_are_rejected_and_counted(gyro, accel, problem):
    filter_ = OrientationFilter()
    before = at_rest(filter_, 100)
    assert filter_.update(100 * STEP, gyro, accel) is problem
    assert filter_.rejected == 1
    after = filter_.update(101 * STEP, (0, 0, 0), UP)
    assert after.orientation == pytest.approx(before.orientation, abs=1e-3)


def test_repeated_and_reordered_stamps_are_rejected_and_change_nothing():
    random = np.random.default_rng(4)
    samples = [(k * STEP, noisy((0.1, 0, 0), random, 0.01), noisy(UP, random, 0.02)) for k in range(50)]
    clean, disturbed = OrientationFilter(), OrientationFilter()
    for k, sample in enumerate(samples):
        expected = clean.update(*sample)
        result = disturbed.update(*sample)
        if k > 3:
            assert disturbed.update(samples[k][0], (1, 1, 1), UP) is Problem.REPEATED_STAMP
            assert disturbed.update(samples[k - 2][0], (1, 1, 1), UP) is Problem.REORDERED_STAMP
    assert result.orientation == expected.orientation


def test_a_clock_that_was_set_back_starts_a_new_stream():
    filter_ = OrientationFilter()
    at_rest(filter_, 100, start=10**18)
    problems = []
    for k in range(12):
        result = filter_.update(k * STEP, (0, 0, 0), UP)
        problems.append(result if isinstance(result, Problem) else result.problem)
    assert problems[:9] == [Problem.REORDERED_STAMP] * 9
    assert problems[9:] == [Problem.CLOCK_RESTARTED, Problem.NONE, Problem.NONE]


def test_missing_samples_are_replaced_by_the_rates_around_them():
    filter_ = OrientationFilter(options_without_delay())
    at_rest(filter_, 300)
    rate, angle, random = 0.5, 0.0, np.random.default_rng(8)
    for k in range(300):
        angle += rate * 0.01
        if 100 <= k < 120:  # 0.2 s are lost
            continue
        accel = (0.0, 9.81 * math.sin(angle), 9.81 * math.cos(angle))
        estimate = filter_.update((300 + k) * STEP, noisy((rate, 0, 0), random, 0.1 * DEG), accel)
        if k == 120:
            assert estimate.problem is Problem.NONE
            replaced = inclination_error(np.array([estimate.orientation]), np.array([quat.exponential(angle, 0, 0)]))[0]
            assert math.degrees(replaced) < 0.5


def test_a_long_gap_restarts_the_inclination_and_keeps_yaw_and_bias():
    filter_ = OrientationFilter(options_without_delay())
    at_rest(filter_, 1000, gyro=(0, 0, 0.5 * DEG))
    for k in range(100):  # turn by 90 deg of yaw
        before = filter_.update((1000 + k) * STEP, (0, 0, math.pi / 2 + 0.5 * DEG), UP)
    tilted = quat.rotate(quat.conjugate(quat.from_roll_pitch_yaw(0.6, 0.0, 0.0)), UP)
    after = filter_.update((1100 + 500) * STEP, (0, 0, 0), tilted)
    assert after.problem is Problem.GAP
    assert quat.yaw_of(after.orientation) == pytest.approx(quat.yaw_of(before.orientation), abs=1e-6)
    assert after.bias == before.bias
    assert after.gravity == pytest.approx((-tilted[0], -tilted[1], -tilted[2]), rel=1e-6)


def test_a_stuck_gyroscope_is_reported_and_the_accelerometer_is_used_alone():
    filter_ = OrientationFilter()
    at_rest(filter_, 300)
    random = np.random.default_rng(5)
    stuck = (20.0 * DEG, 0.0, 0.0)
    for k in range(600):
        estimate = filter_.update((300 + k) * STEP, stuck, noisy(UP, random, 0.02))
    assert estimate.problem is Problem.GYRO_STUCK
    assert math.degrees(inclination_error(np.array([estimate.orientation]), np.array([quat.IDENTITY]))[0]) < 2.0


def test_a_stuck_sensor_is_reported_and_its_uncertainty_grows():
    filter_ = OrientationFilter()
    before = at_rest(filter_, 300)
    for k in range(600):
        estimate = filter_.update((300 + k) * STEP, (0.1, 0.2, 0.3), UP)
    assert estimate.problem is Problem.STUCK
    assert estimate.inclination_std > 10.0 * before.inclination_std


def test_a_simulated_sensor_without_noise_is_used():
    filter_ = OrientationFilter(options_without_delay())
    angle = 0.0
    for k in range(500):
        angle += 0.4 * 0.01
        estimate = filter_.update(k * STEP, (0.4, 0.0, 0.0), (0.0, 9.81 * math.sin(angle), 9.81 * math.cos(angle)))
    assert estimate.problem is Problem.GYRO_STUCK
    assert math.degrees(inclination_error(np.array([estimate.orientation]), np.array([quat.exponential(angle, 0, 0)]))[0]) < 0.5


def test_saturation_is_reported_and_trusted_less():
    filter_ = OrientationFilter()
    before = at_rest(filter_, 300)
    random = np.random.default_rng(6)
    for k in range(5):
        estimate = filter_.update((300 + k) * STEP, (math.radians(2000.0), 0, 0), noisy(UP, random, 0.02))
    assert estimate.problem is Problem.GYRO_SATURATED
    assert estimate.inclination_std > 3.0 * before.inclination_std
    estimate = filter_.update(305 * STEP, noisy((0, 0, 0), random, 0.01), (0, 0, 235.0))
    assert estimate.problem is Problem.ACCEL_SATURATED


def test_bias_estimation_can_be_switched_and_reset_while_running():
    filter_ = OrientationFilter()
    bias = (1.0 * DEG, 0, 0)
    learned = at_rest(filter_, 500, gyro=bias).bias
    filter_.set_bias_estimation(False)
    assert at_rest(filter_, 200, gyro=(1.2 * DEG, 0, 0), start=500 * STEP).bias == learned
    filter_.set_bias_estimation(True)
    filter_.reset_bias()
    assert filter_.update(700 * STEP, bias, UP).bias[0] < 0.5 * DEG
    assert at_rest(filter_, 800, gyro=bias, start=701 * STEP).bias[0] == pytest.approx(1.0 * DEG, abs=0.05 * DEG)


def test_the_sensors_delay_is_compensated_with_the_rate():
    late = OrientationFilter(options_without_delay())
    punctual = OrientationFilter(FilterOptions(sensor=SensorOptions(delay=0.01)))
    for k in range(100):
        a = late.update(k * STEP, (0, 0, 1.0), UP).orientation
        b = punctual.update(k * STEP, (0, 0, 1.0), UP).orientation
    assert quat.yaw_of(b) - quat.yaw_of(a) == pytest.approx(0.01, rel=1e-3)


def test_translations_do_not_make_the_bias_about_the_vertical_drift():
    filter_ = OrientationFilter(options_without_delay())
    random, pitch = np.random.default_rng(9), 0.0
    for k in range(4000):
        time = k * 0.01
        # Swung by an arm from the first sample on: tilt and acceleration are correlated, unlike the white noise of the filter's
        # model.
        before, pitch = pitch, 0.3 * math.sin(4.0 * time)
        push = 3.0 * math.sin(4.0 * time)
        q = quat.exponential(0.0, pitch, 0.0)
        accel = quat.rotate(quat.conjugate(q), (push, 0.0, 9.81))
        gyro = (0.0, (pitch - before) / 0.01, 0.0)
        estimate = filter_.update(k * STEP, noisy(gyro, random, 0.1 * DEG), noisy(accel, random, 0.05))
    assert abs(estimate.bias[2]) < 0.5 * DEG


def test_an_inclination_that_a_rest_contradicts_is_restarted():
    """After wrong stamps inclination and bias are wrong and their covariances small; the next rest corrects both."""
    filter_, random = OrientationFilter(), np.random.default_rng(3)
    at_rest(filter_, 1000)
    rate, stamp, problems = math.radians(20.0), 1000 * STEP, []

    def sample(gyro, turned, step):
        nonlocal stamp
        stamp += step
        accel = (0.0, 9.81 * math.sin(turned), 9.81 * math.cos(turned))
        return filter_.update(stamp, noisy(gyro, random, 0.1 * DEG), noisy(accel, random, 0.02))

    def tilt(estimate):
        return math.atan2(-estimate.gravity[1], -estimate.gravity[2])

    for k in range(100):
        estimate = sample((rate, 0.0, 0.0), rate * 0.01 * k, 2 * STEP)  # the stamps advance twice as fast as time
    assert abs(tilt(estimate) - rate) > 10.0 * DEG
    for _ in range(600):
        estimate = sample((0.0, 0.0, 0.0), rate, STEP)
        problems.append(estimate.problem)
    assert problems.count(Problem.CONTRADICTED) == 1
    assert tilt(estimate) == pytest.approx(rate, abs=0.3 * DEG)
    assert math.hypot(*estimate.bias) < 0.3 * DEG
