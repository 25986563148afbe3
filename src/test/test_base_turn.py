"""Forces of a turning base: their place on the robot, their size, and which rates count."""

import dataclasses

import numpy as np
import pytest

from gravcomp.description import Elements, load_robot_file
from gravcomp.external_loads import BaseTurnOptions
from gravcomp.external_loads.base_turn import BaseTurn
from gravcomp.full_model.modes import first_period
from gravcomp.full_model.robot_model import RobotModel

PERIOD = 0.01  # s


@pytest.fixture(scope="module")
def robot():
    return dataclasses.replace(load_robot_file("article").robot, elements=Elements(around=4, along=4))


@pytest.fixture(scope="module")
def model(robot):
    return RobotModel(robot)


@pytest.fixture
def turn(model):
    return BaseTurn(model, BaseTurnOptions())


def test_height_and_period_are_those_of_a_clamped_beam(robot, turn):
    """Uniform: deflections of the tip q L^4 / (8 E I) under q, and 11 q L^5 / (120 E I) under q z."""
    assert turn.height == pytest.approx(11.0 / 15.0 * robot.length, rel=0.01)
    assert turn.period == pytest.approx(first_period(robot), rel=0.02)


def test_a_payload_raises_the_place(robot, turn):
    heavy = dataclasses.replace(robot, payload=dataclasses.replace(robot.payload, mass=1.0))
    assert turn.height < BaseTurn(RobotModel(heavy), BaseTurnOptions()).height < robot.length
    assert BaseTurn(RobotModel(heavy), BaseTurnOptions()).height == pytest.approx(robot.length, rel=0.01)


def test_a_steady_change_of_the_rate_gives_the_forces_of_the_turning_frame(turn):
    change, start = np.array([2.0, -1.0, 0.5]), np.array([0.3, 0.5, -0.4])
    rate = start
    for k in range(200):
        rate = start + change * k * PERIOD
        turn.add(k * PERIOD, rate)
        turn.acceleration(k * PERIOD)
    at = np.array([0.0, 0.0, turn.height])
    behind = rate - change * turn.options.lag * turn.period  # a low-pass of a ramp is late by its time constant
    expected = -np.cross(change, at) - np.cross(behind, np.cross(behind, at))
    assert turn.acceleration(200 * PERIOD) == pytest.approx(expected, rel=1e-3)


def test_only_fresh_rates_from_before_the_sample_count(turn):
    for k in range(3):
        turn.add(k * PERIOD, np.array([0.1 * k, 0.0, 0.0]))
    before = turn.acceleration(2 * PERIOD)
    turn.add(2 * PERIOD, np.array([np.nan, 0.0, 0.0]))
    assert turn.acceleration(2 * PERIOD) == pytest.approx(before)
    assert turn.acceleration(3 * PERIOD) != pytest.approx(before)
    assert turn.acceleration(0.5) == pytest.approx(np.zeros(3))


def test_it_can_be_switched_off(model):
    off = BaseTurn(model, BaseTurnOptions(enabled=False))
    for k in range(3):
        off.add(k * PERIOD, np.array([float(k), 0.0, 0.0]))
    assert not off.acceleration(3 * PERIOD).any()
