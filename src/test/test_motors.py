"""Counting of turns, motor faults, the last clamp, the position loop, and the knee of homing."""

import dataclasses
import math
import random

import numpy as np
import pytest

from gravcomp.canbus import codec
from gravcomp.config import ConfigError
from gravcomp.description.hardware import COUNTS_PER_TURN, Drive, Watchdog, parse_hardware
from gravcomp.motors.encoder import JUMPS, SETTLING_TIME, Encoder, stays_countable
from gravcomp.motors.homing import find_knee
from gravcomp.motors.loop import PositionLoop
from gravcomp.motors.monitor import MotorMonitor
from gravcomp.motors.output import CurrentOutput
from gravcomp.motors.setpoint import Setpoint

RPM = 60.0 / COUNTS_PER_TURN  # rpm of one count per second


def spin(encoder, rpm, duration, rate, start=0.0, loss=0.0):
    """Feed a steady rotation; return the true count at the end."""
    true, now = start, 100.0
    for k in range(int(duration * rate)):
        now, true = 100.0 + k / rate, start + rpm / RPM * k / rate
        if random.random() >= loss:
            encoder.update(math.floor(true) % COUNTS_PER_TURN, rpm, 0.0, now)
    return math.floor(true)


@pytest.mark.parametrize("rpm", [0, 30, -30, 2750, -2750, 17000, -17000])
@pytest.mark.parametrize("rate", [1000, 500, 125])
def test_turns_are_counted_at_every_speed_of_the_motor(rpm, rate):
    encoder = Encoder()
    true = spin(encoder, rpm, 3.0, rate, start=5000)
    assert encoder.count == true and encoder.rejected == 0


def test_turns_survive_a_third_of_the_frames_being_lost():
    random.seed(1)
    encoder = Encoder()
    true = spin(encoder, 2750, 5.0, 500, loss=0.33)
    assert abs(encoder.count - true) < 2750 / RPM * 0.02 and encoder.rejected == 0


def test_the_wrap_is_at_8192():
    """Drivers that wrap at 8191 lose one count per turn: 36,000 turns would lose 4.4 turns."""
    encoder = Encoder()
    for k in range(40_000):
        encoder.update(k * 2000 % COUNTS_PER_TURN, 2000 * 500 * RPM, 0.0, k / 500)
    assert encoder.count == 39_999 * 2000


def delayed(rpm, pause):
    """Return an encoder whose frames repeatedly come `pause` (s) late and all at once, and the true count."""
    encoder, late = Encoder(), round(pause / 0.002)
    for k in range(2000):
        count = rpm / RPM * 0.002 * k
        arrival = 0.002 * k if k % 200 < 100 or k % 200 >= 100 + late else 0.002 * (k - k % 200 + 100 + late)
        encoder.update(int(count // 1) % COUNTS_PER_TURN, rpm, 0.0, arrival)
        assert encoder.jumps < JUMPS
    return encoder, count


@pytest.mark.parametrize("rpm", [0, 100, -300, 1500, -2750, 5000])
@pytest.mark.parametrize("pause", [0.01, 0.03, 0.06, 0.1, 0.15])
def test_late_frames_are_no_jumps_and_lose_no_turn_silently(rpm, pause):
    encoder, count = delayed(rpm, pause)
    if encoder.certain:
        assert encoder.count == pytest.approx(count, abs=1 + abs(rpm) / RPM * 0.002 * JUMPS)


@pytest.mark.parametrize(
    ("rpm", "pause"), [(0, 0.5), (100, 0.1), (-300, 0.1), (700, 0.1), (-1720, 0.1), (2750, 0.08), (5000, 0.06)]
)
def test_turns_of_frames_that_come_late_and_all_at_once_are_counted(rpm, pause):
    """700 rpm are 10 mm/s of cable, 1720 are 25 mm/s."""
    encoder, count = delayed(rpm, pause)
    assert encoder.certain and encoder.count == pytest.approx(count, abs=1)


def test_turns_in_doubt_are_decided_within_0_2_s_or_not_at_all():
    """Lost frames leave two counts for the same angle, and later feedback excludes neither."""
    encoder, begin = Encoder(), 0.5
    settling = []
    for k in range(500):
        now = 0.002 * k
        if not begin <= now < begin + 0.03:
            encoder.update(int(2750 / RPM * now) % COUNTS_PER_TURN, 2750, 0.0, now)
            settling += [now] * encoder.settling
    assert not encoder.certain and not encoder.settling
    assert begin + 0.03 <= min(settling) and max(settling) < begin + 0.03 + SETTLING_TIME + 0.003


@pytest.mark.parametrize("stalls", [[(0.02, 0.06)], [(0.03, 0.09)], [(0.02, 0.05), (0.054, 0.09)], [(0.06, 0.11), (0.112, 0.15)]])
@pytest.mark.parametrize("start", [0, 2000, 5000])
@pytest.mark.parametrize("sense", [1, -1])
def test_turns_are_counted_when_delayed_frames_contain_acceleration_and_deceleration(stalls, start, sense):
    """125 feedbacks per second; from rest to 1900 rpm in 0.08 s, and back to rest."""
    encoder, waiting = Encoder(), []
    for k in range(60):
        now = 0.008 * k
        t = min(now, 0.16)
        rpm = sense * 1900 * (t if t < 0.08 else 0.16 - t) / 0.08
        turned = 1900 / RPM * (t * t / 0.16 if t < 0.08 else 0.08 - (0.16 - t) ** 2 / 0.16)
        waiting.append((int((start + sense * turned) // 1) % COUNTS_PER_TURN, rpm))
        if not any(begin <= now < end for begin, end in stalls):
            for angle, speed in waiting:
                encoder.update(angle, speed, 0.0, now)
            waiting = []
    assert encoder.certain and encoder.rejected == 0
    assert encoder.count == pytest.approx(start + sense * turned, abs=2)


@pytest.mark.parametrize("rpm", [100, -700, 1500, 2750])
@pytest.mark.parametrize("gap", [0.004, 0.02, 0.05, 0.08, 0.2, 0.9])
@pytest.mark.parametrize("start", [0, 3000, 6000])
def test_lost_frames_lose_no_turn_silently(rpm, gap, start):
    """The encoder cannot distinguish lost frames from late ones, which need another count for the same angle."""
    encoder = Encoder()
    for k in range(1000):
        count = start + rpm / RPM * 0.002 * k
        if not 0.5 <= 0.002 * k < 0.5 + gap:
            encoder.update(int(count) % COUNTS_PER_TURN, rpm, 0.0, 0.002 * k)
    assert not encoder.certain or encoder.count == int(count)


def after_silence(rpm, silence, late):
    """Return whether the count is certain and right after a silence: the rotor stood meanwhile, or its frames come late."""
    encoder, now, turned = Encoder(), 0.0, 0.0
    for k in range(300):
        if k == 100 and not late:
            now += silence
        turned = rpm / RPM * 0.008 * k
        arrival = now + 0.008 * k
        if late and 0.8 <= arrival < 0.8 + silence:
            arrival = 0.8 + silence + 0.001 * (k - 100)  # one in a millisecond, until the last late one has come
        encoder.update(int(turned) % COUNTS_PER_TURN, rpm, 0.0, arrival)
    return encoder.certain and encoder.count == int(turned)


@pytest.mark.parametrize("rpm", [0, 20, 100, 200, 500, 1500])
@pytest.mark.parametrize("silence", [0.02, 0.06, 0.1, 0.12, 0.3])
def test_a_rotor_that_stands_in_a_silence_keeps_its_turns_where_this_is_said(rpm, silence):
    if stays_countable(rpm, silence):
        assert after_silence(rpm, silence, late=False)


def test_a_fast_rotor_keeps_its_turns_only_where_its_frames_come_late():
    assert not stays_countable(1500, 0.15) and stays_countable(100, 0.1) and stays_countable(0, 3.0)
    assert not after_silence(1500, 0.15, late=False) and after_silence(1500, 0.15, late=True)
    assert after_silence(1500, 0.3, late=True)


def test_a_rotor_that_was_turned_by_hand_without_feedback_has_uncertain_turns():
    encoder = Encoder()
    encoder.update(1000, 0, 0.0, 0.0)
    assert encoder.update(4000, 0, 0.0, 0.3) and not encoder.certain
    encoder.trust()
    assert encoder.update(4001, 0, 0.0, 0.302) and encoder.certain


def test_a_rotor_at_rest_at_the_same_angle_has_not_moved():
    encoder = Encoder()
    encoder.update(8190, 0, 0.0, 0.0)
    assert encoder.update(3, 0, 0.0, 0.9) and encoder.certain and encoder.count == 8195


def test_single_jumps_are_ignored_and_repeated_ones_detected():
    encoder = Encoder()
    for k in range(10):
        assert encoder.update(4000, 0, 0.0, k * 0.002)
    assert not encoder.update(1200, 0, 0.0, 0.022)
    for k in range(2):
        assert encoder.update(4001, 0, 0.0, 0.024 + k * 0.002)
    assert encoder.count == 4001 and encoder.jumps == 0
    for k in range(JUMPS):
        encoder.update(1200, 0, 0.0, 0.028 + k * 0.002)
    assert encoder.jumps == JUMPS and encoder.count == 4001


def test_two_controllers_with_one_id_are_detected():
    encoder = Encoder()
    for k in range(20):
        encoder.update(4000 if k % 2 else 1200, 0, 0.0, k * 0.001)
    assert encoder.jumps >= JUMPS


def test_a_speed_that_no_motor_reaches_between_two_feedbacks_is_rejected():
    encoder = Encoder()
    encoder.update(4000, 0, 0.0, 0.0)
    assert not encoder.update(4000, 15_000, 0.0, 0.002) and encoder.certain


@pytest.mark.parametrize(("angle", "speed"), [(8192, 0), (65535, 0), (100, 32767), (100, -32768)])
def test_impossible_feedback_is_rejected(angle, speed):
    assert not Encoder().update(angle, speed, 0.0, 0.0)


@pytest.mark.parametrize(
    ("current", "velocity", "complaint"), [(1.0, 0.0, "stalled"), (-1.0, 0.03, "against"), (0.1, 0.1, "runs away")]
)
def test_a_motor_fault_must_last_in_the_observed_time(current, velocity, complaint):
    """A delayed control sees two feedbacks half a second apart; that does not count as half a second of the fault."""
    monitor = MotorMonitor(Drive(), Watchdog())
    assert not any(monitor.update(0.5 * k, current, velocity, 0.0) for k in range(3))
    assert not any(monitor.update(1.0, current, velocity, 0.0) for _ in range(1000))  # no new feedback
    assert complaint in next(filter(None, (monitor.update(1.0 + 0.002 * k, current, velocity, 0.0) for k in range(100))))


@pytest.mark.parametrize("limit", [0.05, 1.0, 2.3456, 10.0])
def test_no_frame_exceeds_the_limit_for_any_input(limit):
    random.seed(5)
    output = CurrentOutput([1, 2, 5], limit)
    wild = [math.nan, math.inf, -math.inf, 1e300, -1e300, 32.767, -32.768, limit, -limit, 0.0]
    for _ in range(3000):
        asked = [random.choice([*wild, random.gauss(0, 10)]) for _ in range(3)]
        for frame in output.frames(asked, enabled=True):
            for current in codec.decode(frame).values:
                assert abs(current) <= limit
    for frame in output.frames([1.0] * 3, enabled=False):
        assert bytes(frame.data) == bytes(8)


def test_ids_without_a_motor_get_zero_and_frames_without_a_motor_are_not_sent():
    (frame,) = CurrentOutput([3], 1.0).frames([0.5], enabled=True)
    assert codec.decode(frame).values == (0, 0, pytest.approx(0.5), 0)


def test_a_nan_current_is_zero():
    (frame,) = CurrentOutput([1], 1.0).frames([math.nan], enabled=True)
    assert bytes(frame.data) == bytes(8)


def test_the_setpoint_keeps_velocity_and_acceleration_limits():
    drive = Drive()
    setpoint, dt = Setpoint(drive.acceleration_limit), 0.004
    path = []
    for k in range(500):
        setpoint.advance(0.02 if k < 200 else -0.005, drive.velocity_limit, dt)
        path.append((setpoint.position, setpoint.velocity))
    x, v = np.array(path).T
    assert np.abs(v).max() <= drive.velocity_limit * (1 + 1e-9)
    assert np.abs(np.diff(v)).max() <= drive.acceleration_limit * dt * (1 + 1e-9)
    assert x[199] == 0.02 and x[-1] == -0.005
    assert x.max() <= 0.02 and x.min() >= -0.005


def test_tension_feed_forward_is_the_torque_of_the_capstan():
    drive = dataclasses.replace(Drive(), torque_constant=0.2, capstan_radius=0.01)
    assert PositionLoop(drive).step(0.0, 2.0, 0.0, 0.0, 0.004) == pytest.approx(2.0 * 0.01 / 0.2)


def test_the_knee_is_found_in_noise():
    rng = np.random.default_rng(0)
    x = np.linspace(0, 0.008, 600)
    current = 0.11 + 9.0 * np.maximum(0, x - 0.0052) + 0.004 * rng.standard_normal(600)
    knee = find_knee(list(x), list(current))
    assert knee.position == pytest.approx(0.0052, abs=2e-4)  # 4 mA of noise on 9 A/m
    assert knee.slope == pytest.approx(9.0, rel=0.1) and knee.current == pytest.approx(0.11, abs=0.002)


MOTORS = [{"cable": "a", "can_id": 1}, {"cable": "b", "can_id": 2}]


@pytest.mark.parametrize(
    ("section", "complaint"),
    [
        ({}, "hardware.motors' is missing"),
        ({"motors": []}, "0 motors; allowed: 1 to 8"),
        ({"motors": [MOTORS[0], {"cable": "b", "can_id": 1}]}, "can_id 1 is given to more than one motor"),
        ({"motors": [MOTORS[0], {"cable": "a", "can_id": 2}]}, "cable a is given to more than one motor"),
        ({"motors": [MOTORS[0], {"cable": "b", "can_id": 9}]}, r"hardware.motors\[1\].can_id is 9; allowed: 1 to 8"),
        ({"motors": [MOTORS[0], {"cable": "b", "can_id": 2, "direction": 0}]}, "direction is 0; allowed: one of 1, -1"),
        ({"motors": MOTORS[::-1]}, "needed, in this order: a, b"),
        ({"motors": MOTORS, "drive": {"current_limit": 11}}, "hardware.drive.current_limit is 11.*; allowed: 0.05 to 10 A"),
        ({"motors": MOTORS, "drive": {"capstan_radius": 5}}, "did you mean 'capstan_radius_mm'"),
        ({"motors": MOTORS, "watchdog": {"command_timeout_ms": 0}}, "command_timeout_ms is 0.*; allowed: 20 to 5000 ms"),
    ],
)
def test_bad_hardware_is_refused_with_file_and_key(section, complaint):
    with pytest.raises(ConfigError, match=f"robot.yaml.*{complaint}"):
        parse_hardware(section, source="robot.yaml", cables=("a", "b"))
