"""From raw samples to gravity in soft_base: repeatable bit for bit, predicted in time, correct while the chip warms up."""

import math

import numpy as np
import pytest

from gravcomp.orientation import (
    BiasModelError,
    BiasTemperatureModel,
    EstimatorOptions,
    FilterOptions,
    GravityEstimator,
    ImuCalibration,
    Problem,
    estimate_recording,
)
from gravcomp.orientation import quaternion as quat
from gravcomp.orientation.options import SensorOptions
from gravcomp.orientation.prediction import PredictionOptions
from gravcomp.recordings.imu import Recording

DEG = math.radians(1.0)
STEP = 10_000_000  # ns: 100 Hz
WITHOUT_DELAY = FilterOptions(sensor=SensorOptions(delay=0.0))


def wobbling(count, *, bias=(0.0, 0.0, 0.0), seed=1):
    random = np.random.default_rng(seed)
    time = np.arange(count)[:, None] * 0.01
    gyro = 0.3 * np.sin(time * np.array([1.0, 1.7, 2.3])) + random.normal(0.0, 0.002, (count, 3)) + bias
    accel = np.array([0.0, 0.0, 9.81]) + random.normal(0.0, 0.05, (count, 3))
    temperature_stamp = np.arange(0, count * STEP, 100 * STEP)
    temperature = np.round(8.0 * (20.0 + 0.01 * np.arange(len(temperature_stamp)))) / 8.0
    return Recording("made", np.arange(count) * STEP, gyro, accel, temperature_stamp, temperature)


def test_the_same_samples_give_the_same_result_bit_for_bit():
    recording = wobbling(1000)
    first, second = estimate_recording(recording), estimate_recording(recording)
    for name in ("orientation", "gravity", "bias", "inclination_std"):
        assert np.array_equal(getattr(first, name), getattr(second, name))


def test_the_order_in_which_temperatures_arrive_between_samples_does_not_matter():
    recording, model = wobbling(1000), BiasTemperatureModel()
    model.learn(20.0, (0.01, 0.0, 0.0), 30.0)
    model.learn(25.0, (0.02, 0.0, 0.0), 30.0)
    early, late = GravityEstimator(bias_model=model), GravityEstimator(bias_model=model)
    readings = list(zip(recording.temperature_stamp_ns.tolist(), recording.temperature.tolist()))
    waiting = list(readings)
    for reading in readings:  # all arrive before the first sample
        early.add_temperature(*reading)
    for stamp, gyro, accel in recording.samples():
        while waiting and waiting[0][0] <= stamp - 9 * STEP:  # 0.09 s after the sample of their stamp
            late.add_temperature(*waiting.pop(0))
        a, b = early.update(stamp, gyro, accel), late.update(stamp, gyro, accel)
    assert a.imu.orientation == b.imu.orientation and a.bias == b.bias


def test_gravity_is_given_in_soft_base():
    mount = quat.from_roll_pitch_yaw(0.0, math.pi / 2, 0.0)  # x of the IMU points down soft_base's z
    estimate = GravityEstimator(mount=mount).update(0, (0, 0, 0), (0, 0, 9.81))
    assert estimate.imu.gravity == pytest.approx((0, 0, -9.81))
    assert estimate.gravity == pytest.approx((-9.81, 0, 0), abs=1e-9)


def test_prediction_gives_the_gravity_of_a_horizon_later():
    horizon = 0.1
    options = EstimatorOptions(filter=WITHOUT_DELAY, prediction=PredictionOptions(horizon=horizon))
    estimator, angle, rate = GravityEstimator(options), 0.0, 0.4  # rad/s: 23 deg/s
    random = np.random.default_rng(2)
    for k in range(500):
        angle += rate * 0.01
        accel = (0.0, 9.81 * math.sin(angle), 9.81 * math.cos(angle))
        estimate = estimator.update(k * STEP, np.array([rate, 0, 0]) + random.normal(0, 0.002, 3), accel)
    later = angle + rate * horizon
    expected = np.array([0.0, -math.sin(later), -math.cos(later)])
    error = math.acos(min(1.0, float(np.dot(estimate.gravity, expected)) / 9.81))
    now = math.acos(min(1.0, float(np.dot(estimate.imu.gravity, expected)) / 9.81))
    assert error < 0.2 * now


def test_calibration_is_applied_before_the_filter():
    calibration = ImuCalibration(accel_scale=(1.0, 1.0, 1.02), accel_offset=(0.1, 0.0, -0.2), gyro_offset=(0.01, 0.0, 0.0))
    raw = (0.1, 0.0, 9.81 / 1.02 - 0.2)
    estimate = GravityEstimator(EstimatorOptions(calibration=calibration)).update(0, (0.01, 0.0, 0.0), raw)
    assert estimate.accel == pytest.approx((0, 0, 9.81))
    assert estimate.imu.angular_velocity == pytest.approx((0, 0, 0))
    assert estimate.bias == pytest.approx((0.01, 0, 0))


def warming(model, *, rotating, seconds=30):
    """Yaw error (rad) at the end, and the estimator; a chip warms from 20 to 35 degC, its bias about z rises by 0.015 deg/s/K."""
    estimator, random, true_yaw = (
        GravityEstimator(EstimatorOptions(filter=WITHOUT_DELAY), bias_model=model),
        np.random.default_rng(3),
        0.0,
    )
    for k in range(seconds * 100):
        time = k * 0.01
        temperature = 35.0 - 15.0 * math.exp(-time / 15.0)
        if k % 100 == 0:
            estimator.add_temperature(k * STEP, round(8 * temperature) / 8)
        rate = 0.4 if rotating and time > 5.0 else 0.0
        true_yaw += rate * 0.01
        gyro = np.array([0.0, 0.0, rate + 0.5 * DEG + 0.015 * DEG * (temperature - 20.0)]) + random.normal(0, 0.1 * DEG, 3)
        estimate = estimator.update(k * STEP, gyro, np.array([0, 0, 9.81]) + random.normal(0, 0.02, 3))
    error = quat.multiply(estimate.imu.orientation, quat.exponential(0.0, 0.0, -true_yaw))
    return abs(2.0 * math.atan2(error[3], error[0])), estimator


def test_the_bias_model_of_one_warm_up_reduces_the_error_in_the_next(tmp_path):
    _, estimator = warming(None, rotating=False)
    assert estimator.learned.span[0] < 23.0 and estimator.learned.span[1] > 32.0
    path = tmp_path / "kept" / "bias.json"
    estimator.learned.save(path)
    model = BiasTemperatureModel.load(path)
    assert model.bias(30.0)[2] == pytest.approx(0.65 * DEG, abs=0.03 * DEG)
    without, _ = warming(None, rotating=True)
    with_model, _ = warming(model, rotating=True)
    assert with_model < 0.3 * without


def test_the_bias_model_of_another_board_is_dropped_at_the_first_rest():
    random, model = np.random.default_rng(4), BiasTemperatureModel()
    model.learn(25.0, np.radians([1.0, -1.0, 1.0]), 60.0)
    estimator = GravityEstimator(bias_model=model)
    estimator.add_temperature(0, 25.0)
    own = np.radians([-0.2, 0.3, 0.1])
    for k in range(1000):
        estimate = estimator.update(
            k * STEP, own + random.normal(0, 0.1 * DEG, 3), np.array([0, 0, 9.81]) + random.normal(0, 0.02, 3)
        )
    assert estimate.imu.rest
    assert estimate.bias == pytest.approx(own, abs=0.05 * DEG)


def test_a_file_that_is_no_bias_model_is_refused_by_name(tmp_path):
    path = tmp_path / "bias.json"
    assert BiasTemperatureModel.load(path).span is None
    for text in ("not json", '{"format": "other", "bins": []}', '{"format": "gravcomp bias over temperature 1", "bins": [{}]}'):
        path.write_text(text, encoding="utf-8")
        with pytest.raises(BiasModelError, match=r"bias\.json"):
            BiasTemperatureModel.load(path)


def test_beyond_the_learned_span_the_value_at_its_end_holds():
    model = BiasTemperatureModel()
    for temperature in range(20, 31):
        model.learn(temperature, (0.001 * temperature, 0.0, 0.0), 10.0)
    assert model.bias(60.0)[0] == pytest.approx(0.030)
    assert model.bias(-10.0)[0] == pytest.approx(0.020)


def test_rejected_samples_repeat_the_previous_row():
    recording = wobbling(50)
    recording.gyro[20] = np.nan
    result = estimate_recording(recording)
    assert np.array_equal(result.orientation[20], result.orientation[19])
    assert result.problems == {Problem.NOT_FINITE.value: 1}
