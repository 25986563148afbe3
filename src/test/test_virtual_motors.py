"""Motors, gears and capstans of the virtual robot."""

import dataclasses
import math

import numpy as np
import pytest
from virtual_article import article, given

from gravcomp.description.hardware import Hardware, Motor
from gravcomp.virtual.draw import draw
from gravcomp.virtual.motors import TICK, MotorBank
from gravcomp.virtual.true_robot import TrueMotors

MOTORS = given().motors
SPRING = np.full(6, 3000.0)


def bank(slack=0.0, directions=(1,) * 6, **changes) -> MotorBank:
    robot, hardware = article()
    motors = tuple(dataclasses.replace(motor, direction=d) for motor, d in zip(hardware.motors, directions))
    hardware = dataclasses.replace(hardware, motors=motors)
    parameters = dataclasses.replace(given(), motors=dataclasses.replace(MOTORS, **changes))
    return MotorBank(draw(parameters, robot, hardware).motors, hardware, np.full(6, slack), np.random.default_rng(1))


def same_motors(hardware: Hardware, **changes) -> TrueMotors:
    """The article's motors, as many as the hardware has."""
    common, count = dataclasses.replace(MOTORS, **changes), len(hardware.motors)
    varying = ("torque_constant", "capstan_radius", "backlash", "load_friction")
    return TrueMotors(*(np.full(count, getattr(common, name)) for name in varying), common)


def run(motors, seconds, shortened=0.0):
    motors.step(round(seconds / TICK), np.full(6, shortened), SPRING)


def test_the_last_current_is_kept():
    motors = bank(slack=10.0)
    motors.commanded[:] = 0.5
    run(motors, 1.0)
    speed = motors.feedback()[0]["speed"]
    run(motors, 5.0)
    assert motors.feedback()[0]["speed"] >= speed > 1000
    assert motors.feedback()[0]["current"] == pytest.approx(0.5, abs=0.03)


def test_a_current_below_friction_does_not_move_and_above_does():
    friction_current = MOTORS.friction_torque / (MOTORS.torque_constant / 36)
    motors = bank(slack=10.0, capstan_drag=0.0)
    motors.commanded[0], motors.commanded[1] = 0.9 * friction_current, 1.1 * friction_current
    run(motors, 0.5)
    assert motors.wound[0] == pytest.approx(-10.0, abs=1e-9)
    assert motors.wound[1] > -10.0 + 1e-5


def test_cable_force_and_current_balance_at_the_capstan():
    motors = bank(backlash=0.0)
    motors.commanded[:] = 0.4
    run(motors, 3.0)
    tension = 3000.0 * motors.wound[0]
    p = MOTORS
    friction = p.friction_torque * 36 / p.capstan_radius
    wanted = (0.4 * p.torque_constant / p.capstan_radius - friction) / (1 + p.load_friction)
    # While winding in, friction takes part of the torque; after an overshoot the tension is larger.
    assert wanted * 0.99 < tension < (0.4 * p.torque_constant / p.capstan_radius + friction) / (1 - p.load_friction)


def test_backlash_shows_only_when_the_cable_is_slack():
    backlash = math.radians(2.0)
    motors = bank(slack=5.0, backlash=backlash)
    motors.commanded[0] = 0.3
    run(motors, 0.3)
    motors.commanded[0] = 0.0
    run(motors, 2.0)
    wound, angle = motors.wound[0], motors._rotor[0] / 36
    motors.commanded[0] = -0.3
    while motors._rotor[0] / 36 > angle - 0.9 * backlash:
        run(motors, TICK)
    assert motors.wound[0] == wound, "the gear turns inside its backlash"
    run(motors, 1.0)
    turned = angle - motors._rotor[0] / 36
    assert wound - motors.wound[0] == pytest.approx((turned - backlash) * MOTORS.capstan_radius, rel=1e-6)

    taut = bank(backlash=backlash)
    taut.commanded[0] = 0.4
    run(taut, 2.0)
    wound, angle = taut.wound[0], taut._rotor[0] / 36
    taut.commanded[0] = 0.1
    run(taut, 0.3)
    turned = angle - taut._rotor[0] / 36
    assert wound - taut.wound[0] == pytest.approx(turned * MOTORS.capstan_radius, abs=1e-9)


def test_feedback_counts_the_rotor_wraps_at_8192_and_has_the_direction_of_the_motor():
    motors = bank(slack=10.0, directions=(1, -1, 1, 1, 1, 1))
    start = [motors.feedback()[i]["angle"] for i in range(2)]
    motors.commanded[0], motors.commanded[1] = 0.3, -0.3
    travelled, last, wraps = np.zeros(2), list(start), 0
    for _ in range(500):
        run(motors, 1e-3)
        for i in range(2):
            angle = motors.feedback()[i]["angle"]
            assert 0 <= angle < 8192
            step = (angle - last[i] + 4096) % 8192 - 4096
            wraps += abs(angle - last[i]) > 4096
            travelled[i] += step
            last[i] = angle
    assert wraps > 10
    assert travelled[0] > 0 > travelled[1]
    wound = motors.wound[:2] + 10.0
    np.testing.assert_allclose(wound, abs(travelled) / 8192 / 36 * 2 * math.pi * MOTORS.capstan_radius, atol=1e-4)
    assert motors.feedback()[0]["speed"] > 0 > motors.feedback()[1]["speed"]


def test_currents_beyond_ten_amperes_and_speeds_beyond_the_motors_are_not_reached():
    motors = bank(slack=100.0)
    motors.commanded[:] = 32.0
    run(motors, 2.0)
    assert motors.feedback()[0]["speed"] * 2 * math.pi / 60 < MOTORS.no_load_speed
    assert abs(motors.feedback()[0]["current"]) < 10.0


def test_a_stalled_rotor_does_not_turn_and_an_encoder_jumps():
    motors = bank(slack=10.0)
    motors.commanded[:] = 0.5
    motors.stalled[2] = True
    run(motors, 0.5)
    assert motors.wound[2] == -10.0 and motors.feedback()[2]["speed"] == 0
    assert motors.wound[1] > -10.0
    before = motors.feedback()[2]["angle"]
    motors.jump(np.arange(6) == 2)
    assert (motors.feedback()[2]["angle"] - before) % 8192 == 8192 // 3


def test_a_motor_of_two_antagonists_pulls_one_at_a_time_and_carries_their_difference():
    hardware = Hardware(motors=(Motor("a", 1, pair="b", preload=1e-3),))
    motors = MotorBank(same_motors(hardware, load_friction=0.0), hardware, np.zeros(2), np.random.default_rng(1))
    spring = np.full(2, 3000.0)
    for sign in (1.0, -1.0):
        motors.commanded[:] = 0.2 * sign
        motors.step(round(2.0 / TICK), np.zeros(2), spring)
        pulled, other = motors.wound if sign > 0 else motors.wound[::-1]
        force = spring[0] * (max(0.0, pulled) - max(0.0, other))
        torque = MOTORS.torque_constant * 0.2
        friction = MOTORS.friction_torque * hardware.drive.gear_ratio
        assert force * MOTORS.capstan_radius == pytest.approx(torque, abs=1.1 * friction)
        assert pulled + other == pytest.approx(2e-3, abs=1e-12)


def test_a_differential_adds_the_turns_of_its_motors():
    both = ({"b": 1.0}, {"b": -1.0})
    hardware = Hardware(motors=tuple(Motor("a", i + 1, also=also, differential=True) for i, also in enumerate(both)))
    motors = MotorBank(same_motors(hardware), hardware, np.full(2, 10.0), np.random.default_rng(1))
    motors.commanded[:] = [0.5, 0.2]
    motors.step(round(0.2 / TICK), np.zeros(2), np.full(2, 3000.0))
    first, second = motors._capstan * MOTORS.capstan_radius
    assert first > second > 0.0
    assert motors.wound + 10.0 == pytest.approx([first + second, first - second])
