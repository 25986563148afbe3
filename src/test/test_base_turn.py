"""Forces of a turning base: their place on the robot, their size, and which rates count."""

import dataclasses
import functools

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gravcomp.description import Elements, load_robot_file
from gravcomp.external_loads import BaseTurnOptions
from gravcomp.external_loads.base_turn import BaseTurn
from gravcomp.full_model import modes
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


def test_a_robot_without_weight_feels_no_turn(robot):
    material = dataclasses.replace(robot.materials[0], density=0.0)
    weightless = dataclasses.replace(robot, segments=tuple(dataclasses.replace(s, material=material) for s in robot.segments))
    turn = BaseTurn(RobotModel(weightless), BaseTurnOptions())
    assert not follow(turn, PERIOD * np.arange(5)).any()


def test_a_place_on_the_turning_base_accelerates_by_as_much_the_other_way(model):
    """The attitude of the base is a function of time; rates and acceleration are its difference quotients."""
    step, end = 1e-3, 0.7
    turn = BaseTurn(model, BaseTurnOptions(lag=0.01))

    def attitude(time):
        return Rotation.from_rotvec([0.3 * np.sin(3.0 * time), 0.5 * np.sin(2.0 * time), 0.2 * time])

    for k in range(700):
        time = step * k
        turn.add(time, (attitude(time - step).inv() * attitude(time + step)).as_rotvec() / (2.0 * step))
        turn.acceleration(time)
    before, here, after = (attitude(end + t).apply([0.0, 0.0, turn.height]) for t in (-step, 0.0, step))
    expected = -attitude(end).inv().apply(after - 2.0 * here + before) / step**2
    assert turn.acceleration(end) == pytest.approx(expected, abs=0.03 * np.linalg.norm(expected))


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


def follow(turn, times):
    """Give rates that grow evenly; return what acts after each of them."""
    acting = []
    for time in times:
        turn.add(time, np.array([time, 0.0, 0.0]))
        acting.append(turn.acceleration(time + 1e-5))
    return np.array(acting)


def test_after_a_gap_it_begins_again(turn):
    follow(turn, PERIOD * np.arange(20))
    assert not follow(turn, [5.0]).any()
    assert follow(turn, [5.0 + PERIOD]).any()
    assert not turn.acceleration(6.0).any()  # the gap is no interval between rates


def test_rates_in_bursts_act_all_the_time(turn):
    bursts = (4 * PERIOD * np.arange(40)[:, None] + 1e-4 * np.arange(4)).ravel()
    follow(turn, bursts[:-4])
    for time in bursts[-4:]:
        turn.add(time, np.array([time, 0.0, 0.0]))
        assert turn.acceleration(time + 1e-5).any() and turn.acceleration(time + 3.9 * PERIOD).any()


def test_a_replay_that_restarts_acts_as_the_first_one(turn):
    times = PERIOD * np.arange(20)
    first = follow(turn, times)
    turn.add(1.0, np.zeros(3))  # waits for a sample that never comes
    np.testing.assert_array_equal(follow(turn, times), first)


def test_it_can_be_switched_off(model):
    off = BaseTurn(model, BaseTurnOptions(enabled=False))
    for k in range(3):
        off.add(k * PERIOD, np.array([float(k), 0.0, 0.0]))
    assert not off.acceleration(3 * PERIOD).any()


def test_the_first_period_of_a_robot_is_computed_once(monkeypatch):
    """A calibration asks for it at each step."""
    robot, asked = load_robot_file("article").robot.with_material(youngs_modulus=3.21e5), []
    monkeypatch.setattr(modes, "_known_period", functools.lru_cache(modes._period))  # other tests keep what is known
    monkeypatch.setattr(modes, "natural_frequencies", lambda model, count: asked.append(count) or np.array([4.0]))
    assert first_period(robot) == first_period(dataclasses.replace(robot)) == 0.25
    assert len(asked) == 1
    assert first_period(robot.with_material(youngs_modulus=3.22e5)) == 0.25 and len(asked) == 2
