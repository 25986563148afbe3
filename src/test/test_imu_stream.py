"""Samples from frames: complete, each one once, stamped without jitter."""

import math
import random

import can
import pytest

from gravcomp.canbus import codec
from gravcomp.canbus.imu_stream import STUCK_SAMPLES, ImuStream


def status(**changes):
    values = {
        "protocol": 1,
        "firmware_major": 1,
        "firmware_minor": 0,
        "accelerometer_range": 1,
        "gyroscope_range": 0,
        "heater_duty": 0,
        "flags": 0,
    }
    return codec.encode("BoardStatus", **(values | changes))


def sample(index, *, noise=None, period_us=10_000, start_us=0):
    sequence, x = index % 256, index % 7 if noise is None else noise
    return [
        codec.encode("ImuAccelerometer", x=5460, y=x, z=-5460, sequence=sequence),
        codec.encode("ImuGyroscope", x=3277, y=0, z=-x, sequence=sequence),
        codec.encode("ImuTime", time=(start_us + index * period_us) % 2**32, temperature=40.125, sequence=sequence),
    ]


def feed(stream, frames, reception):
    return [s for s in (stream.on_frame(frame, reception) for frame in frames) if s is not None]


@pytest.fixture
def stream():
    stream = ImuStream()
    stream.on_frame(status(), 0.0)
    return stream


def test_counts_become_si_by_the_boards_ranges(stream):
    (s,) = feed(stream, sample(5), 1.0)
    assert s.specific_force == pytest.approx((9.80665, 5 * 9.80665 / 5460, -9.80665))
    assert s.angular_rate[0] == pytest.approx(math.radians(2000) * 3277 / 32767)
    assert s.temperature == 40.125 and s.board_time == 50_000


def test_there_are_no_samples_before_the_ranges_are_known():
    assert feed(ImuStream(), sample(0) + sample(1), 1.0) == []


def test_stamps_have_the_boards_spacing_under_jittery_reception(stream):
    random.seed(1)
    stamps = []
    for k in range(3000):
        reception = (
            100.0 + 0.01 * k * (1 + 40e-6) + 0.001 + random.expovariate(1 / 0.002)
        )  # late by 1 ms and more; clocks 40 ppm apart
        (s,) = feed(stream, sample(k), reception)
        assert s.stamp <= reception + 1e-9
        stamps.append(s.stamp)
    spacing = [b - a for a, b in zip(stamps[500:], stamps[501:])]
    assert max(abs(d - 0.01) for d in spacing) < 2e-4  # jitter of the receptions: 2 ms standard deviation
    late = [stamp - (100.0 + 0.01 * k * (1 + 40e-6)) for k, stamp in enumerate(stamps)]
    assert min(late[500:]) >= 0.001 and max(late[500:]) < 0.0025


def test_repeated_and_reordered_samples_count_once(stream):
    frames = [sample(k) for k in range(10)]
    order = [0, 1, 1, 3, 2, 4, 5, 4, 6]
    got = [s.sequence for i in order for s in feed(stream, frames[i], 1.0 + 0.01 * i)]
    assert got == [0, 1, 3, 4, 5, 6]
    assert stream.counters.repeated == 3 and stream.counters.lost == 1


@pytest.mark.parametrize("missing", [0, 1, 2])
def test_a_sample_with_a_missing_frame_is_not_mixed_with_the_next(stream, missing):
    torn = sample(1)
    del torn[missing]
    got = feed(stream, sample(0), 1.0) + feed(stream, torn, 1.01) + feed(stream, sample(2), 1.02)
    assert [s.sequence for s in got] == [0, 2] and stream.counters.lost == 1


def test_the_boards_clock_may_wrap(stream):
    start = 2**32 - 25_000
    stamps = [s.stamp for k in range(6) for s in feed(stream, sample(k, start_us=start), 50.0 + 0.01 * k)]
    assert [b - a for a, b in zip(stamps, stamps[1:])] == pytest.approx([0.01] * 5, abs=1e-5)


def test_a_restarted_board_is_recognised_and_samples_continue(stream):
    for k in range(1000):
        feed(stream, sample(k), 1.0 + 0.01 * k)
    (s,) = feed(stream, sample(0), 15.0)
    assert stream.counters.restarts == 1 and s.stamp == pytest.approx(15.0)


@pytest.mark.parametrize("step", [30.0, 0.1, -0.1, -3600.0])
def test_a_clock_that_is_set_is_followed(stream, step):
    """The host's clock set by a time server, or the board's clock after it stopped."""
    for k in range(300):
        feed(stream, sample(k), 5000.0 + 0.01 * k)
    late = [
        5000.0 + step + 0.01 * k - s.stamp for k in range(300, 400) for s in feed(stream, sample(k), 5000.0 + step + 0.01 * k)
    ]
    assert late[-1] == pytest.approx(0.0, abs=1e-3)


def test_a_stuck_sensor_is_reported(stream):
    for k in range(STUCK_SAMPLES + 2):
        feed(stream, sample(k, noise=3), 1.0 + 0.01 * k)
    assert "repeats" in stream.fault
    feed(stream, sample(STUCK_SAMPLES + 2, noise=4), 2.0)
    assert stream.fault is None


def test_a_saturated_sensor_is_reported_and_a_knock_is_not(stream):
    for k in range(STUCK_SAMPLES + 2):
        feed(stream, sample(k, noise=32767 - k % 2), 1.0 + 0.01 * k)
    assert stream.fault is None
    for k in range(STUCK_SAMPLES + 2, 2 * STUCK_SAMPLES + 4):
        frames = sample(k)
        frames[0] = codec.encode("ImuAccelerometer", x=32767, y=k, z=0, sequence=k)
        feed(stream, frames, 1.0 + 0.01 * k)
    assert "saturated" in stream.fault


def test_board_faults_are_reported_in_words(stream):
    stream.on_frame(status(flags=1), 0.0)
    assert "does not answer" in stream.fault
    stream.on_frame(status(protocol=9), 0.0)
    assert "version 9" in stream.fault


def test_random_bytes_under_the_boards_ids_do_no_harm(stream):
    random.seed(2)
    for _ in range(20_000):
        frame = can.Message(
            arbitration_id=random.choice((0x310, 0x311, 0x312, 0x313)),
            is_extended_id=False,
            data=random.randbytes(random.randint(0, 8)),
        )
        stream.on_frame(frame, 1.0)
    got = feed(stream, [status(), *sample(0, start_us=1 << 31), *sample(1, start_us=1 << 31)], 2.0)
    assert got and got[-1].sequence == 1
