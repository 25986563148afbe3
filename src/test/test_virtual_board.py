"""The IMU board of the virtual robot, in Python and as the firmware's C code: its frames, its errors, its heater."""

import dataclasses
import math

import numpy as np
import pytest

from gravcomp.canbus.codec import decode
from gravcomp.canbus.imu_scales import accelerometer_scale, gyroscope_scale
from gravcomp.standard_gravity import STANDARD_GRAVITY
from gravcomp.thermal.plant import ThermalPlantOptions
from gravcomp.virtual.board import VirtualBoard
from gravcomp.virtual.emulated_board import EmulatedBoard
from gravcomp.virtual.parameters import Board

IMU_FRAMES = (0x310, 0x311, 0x312)

UP = np.array([0.0, 0.0, STANDARD_GRAVITY])
PERFECT = {
    "accelerometer_noise": 0.0,
    "gyroscope_noise": 0.0,
    "accelerometer_bias": 0.0,
    "accelerometer_scale": 0.0,
    "accelerometer_drift": 0.0,
    "gyroscope_bias": 0.0,
    "gyroscope_drift": 0.0,
    "gyroscope_walk": 0.0,
    "clock_error": 0.0,
}


@pytest.fixture(params=[VirtualBoard, EmulatedBoard])
def board(request):
    def make(seed=1, **changes):
        return request.param(dataclasses.replace(Board(), **changes), np.random.default_rng(seed))

    return make


def imu_frames(board, rate, force, recorded=False):
    return [frame for frame in board.sample(np.array(rate), np.array(force), recorded) if frame.arbitration_id in IMU_FRAMES]


def samples(board, count, rate=(0.0, 0.0, 0.0), force=UP, recorded=False):
    """Specific force (count, 3), angular rate (count, 3) and the ImuTime values as a host reads them."""
    forces, rates, times = [], [], []
    for _ in range(count):
        acceleration, gyroscope, time = (decode(frame).values for frame in imu_frames(board, rate, force, recorded))
        assert acceleration.sequence == gyroscope.sequence == time.sequence
        forces.append(np.array(acceleration[:3]) * accelerometer_scale(Board().accelerometer_range))
        rates.append(np.array(gyroscope[:3]) * gyroscope_scale(Board().gyroscope_range))
        times.append(time)
    return np.array(forces), np.array(rates), times


def test_a_perfect_board_differs_by_half_a_count_only(board):
    force, rate, _ = samples(board(**PERFECT), 5, rate=(0.1, -0.2, 0.3), force=(1.0, 2.0, 9.0))
    np.testing.assert_allclose(force, [[1.0, 2.0, 9.0]] * 5, atol=accelerometer_scale(1) / 2 * 1.001)
    np.testing.assert_allclose(rate, [[0.1, -0.2, 0.3]] * 5, atol=gyroscope_scale(0) / 2 * 1.001)


def test_noise_is_that_of_the_data_sheet(board):
    force, rate, _ = samples(board(gyroscope_walk=0.0), 4000)
    p = Board()
    # 4000 samples: the standard deviation is known to 1.1 %; the quantisation adds 4 % of variance.
    assert force.std(axis=0) == pytest.approx(p.accelerometer_noise * STANDARD_GRAVITY * math.sqrt(p.bandwidth), rel=0.06)
    assert rate.std(axis=0) == pytest.approx(p.gyroscope_noise * math.sqrt(p.bandwidth), rel=0.06)


def test_the_gyroscope_drifts_by_0_015_deg_s_a_kelvin(board):
    quiet = PERFECT | {"gyroscope_drift": Board().gyroscope_drift}
    means = [samples(board(**quiet, thermal=ThermalPlantOptions(ambient=t)), 10)[1].mean(axis=0) for t in (20.0, 40.0)]
    np.testing.assert_allclose(np.abs(means[1] - means[0]), math.radians(0.015) * 20.0, atol=gyroscope_scale(0) * 1.001)


def test_a_recorded_sample_keeps_its_own_errors(board):
    force, rate, _ = samples(board(), 3, rate=(0.1, 0.0, 0.0), force=(0.0, 1.0, 9.7), recorded=True)
    np.testing.assert_allclose(force, [[0.0, 1.0, 9.7]] * 3, atol=accelerometer_scale(1))
    np.testing.assert_allclose(rate, [[0.1, 0.0, 0.0]] * 3, atol=gyroscope_scale(0))


def test_sequence_and_time_continue_and_start_again_after_a_restart(board):
    b = board(**PERFECT)
    _, _, times = samples(b, 300)
    assert [t.sequence for t in times] == [i % 256 for i in range(300)]
    assert times[-1].time == pytest.approx(3_000_000, abs=2)
    b.restart()
    _, _, times = samples(b, 1)
    assert times[0].sequence == 0 and times[0].time == pytest.approx(10_000, abs=2)


def test_temperature_is_renewed_every_1_28_seconds_in_eighths_of_a_degree(board):
    b = board()
    readings = []
    for _ in range(1000):
        b.command_heater(1.0)
        readings.append(samples(b, 1)[2][0].temperature)
    changes = np.flatnonzero(np.diff(readings))
    assert len(changes) >= 5 and (np.diff(changes) >= 127).all()
    assert all(reading % 0.125 == 0 for reading in readings)
    assert readings[-1] == pytest.approx(b.temperature, abs=1.0)


def test_the_heater_is_off_without_commands_and_above_65_degrees(board):
    b = board()
    b.command_heater(0.5)
    samples(b, 10)
    status = decode(b.status()).values
    assert status.heater_duty == pytest.approx(0.5, abs=0.003) and status.flags == 0
    samples(b, 60)
    status = decode(b.status()).values
    assert status.heater_duty == 0 and status.flags == 4
    hot = board(thermal=ThermalPlantOptions(ambient=20.0, rise=80.0, time_constant=5.0))
    seen = []
    for _ in range(3000):
        hot.command_heater(1.0)
        samples(hot, 1)
        seen.append(hot.temperature)
    # The chip renews its reading every 1.28 s; meanwhile the heater warms it by at most 80 / 5 degC/s, less what it loses.
    ahead = (20.0 + 80.0 - 65.0) * (1.0 - math.exp(-1.28 / 5.0))
    behind = (60.0 - 20.0) * (1.0 - math.exp(-1.28 / 5.0))
    assert 64.9 < max(seen) < 65.2 + ahead
    assert min(seen[2000:]) > 59.8 - behind


def test_the_heater_is_off_within_two_seconds_of_a_silent_imu(board):
    b = board()
    b.command_heater(0.5)
    samples(b, 10)
    b.chip.imu_fault = "silent"
    for _ in range(200):
        b.command_heater(0.5)
        b.sample(np.zeros(3), UP, False)
    assert decode(b.status()).values.heater_duty == 0.0
    b.chip.imu_fault = None
    for _ in range(20):
        b.command_heater(0.5)
        b.sample(np.zeros(3), UP, False)
    assert decode(b.status()).values.heater_duty == pytest.approx(0.5, abs=0.003)


def test_firmware_and_python_send_the_same_samples_byte_by_byte():
    boards = [kind(Board(), np.random.default_rng(3)) for kind in (VirtualBoard, EmulatedBoard)]
    for b in boards:
        b.chip.heater_fault = "stuck_on"  # both get equally warm; when a command takes effect is not said to the microsecond
    for _ in range(600):
        first, second = ([bytes(f.data) for f in imu_frames(b, (0.1, 0.2, -0.3), (1.0, 2.0, 9.0))] for b in boards)
        assert first == second


def test_faults_of_imu_and_heater_show_in_the_frames(board):
    b = board()
    b.chip.imu_fault = "stuck"
    force, rate, times = samples(b, 3)
    assert (np.ptp(force, axis=0) == 0).all() and (np.ptp(rate, axis=0) == 0).all()
    assert [t.sequence for t in times] == [0, 1, 2]
    b.chip.imu_fault = "saturated"
    assert np.abs(samples(b, 1)[1]).min() == pytest.approx(math.radians(2000), rel=1e-4)
    b.chip.imu_fault = "invalid"
    assert decode(imu_frames(b, np.zeros(3), UP)[0]).values[:3] == (-32768,) * 3
    b.chip.imu_fault = "silent"
    assert imu_frames(b, np.zeros(3), UP) == []
    for _ in range(10):
        b.sample(np.zeros(3), UP, False)
    assert decode(b.status()).values.flags & 1
    dead = board()
    dead.chip.heater_fault = "dead"
    for _ in range(500):
        dead.command_heater(1.0)
        samples(dead, 1)
    assert dead.temperature == pytest.approx(ThermalPlantOptions().ambient)
    assert decode(dead.status()).values.heater_duty == 1.0
