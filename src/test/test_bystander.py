"""A user next to the virtual robot: a hand at a spring, and a wall that is put there while the robot runs."""

import copy
import dataclasses

import numpy as np
import pytest
from virtual_article import virtual_robot

from gravcomp.config import ConfigError
from gravcomp.virtual.hand import Hand

LENGTH = 0.1
DEPTH = 0.02e-3  # m, that a rigid wall may be entered by


@pytest.fixture(scope="module")
def settled():
    robot = virtual_robot(seed=3)
    robot.step(0.4)
    return robot


@pytest.fixture
def robot(settled):
    return copy.deepcopy(settled)


def pull(robot, place, seconds):
    """Hold the tip at a place (m) for so many s, as a page does: with an order every 0.1 s."""
    for _ in range(round(seconds / 0.1)):
        robot.bystander.order_hand({"place_mm": (1e3 * place).tolist()}, "virtual/hand", robot.time)
        robot.step(0.1)


def test_a_hand_pulls_the_tip_to_it_and_the_tip_comes_back(robot):
    before = robot.truth.tip_position
    pull(robot, before + np.array([0.02, 0.0, 0.0]), 1.5)
    moved, force = robot.truth.tip_position - before, robot.truth.hand_force
    # A spring three times as stiff as the tip takes it three quarters of the way, less what the cables hold.
    assert 0.008 < moved[0] < 0.016 and abs(moved[1]) < 0.002
    assert 0.0 < force[0] < robot.bystander.hand.force_max
    robot.bystander.order_hand("release", "virtual/hand", robot.time)
    robot.step(2.0)
    np.testing.assert_allclose(robot.truth.tip_position, before, atol=3e-4)
    assert not robot.truth.hand_force.any()


def test_a_hand_pulls_no_harder_than_its_largest_force(robot):
    pull(robot, np.array([LENGTH, 0.0, 0.0]), 0.5)
    assert np.linalg.norm(robot.truth.hand_force) == pytest.approx(robot.bystander.hand.force_max, rel=1e-9)


def test_a_hand_that_is_not_heard_of_lets_go(robot):
    pull(robot, np.array([0.02, 0.0, LENGTH]), 0.2)
    assert robot.truth.hand_force.any()
    robot.step(0.7)
    assert not robot.truth.hand_force.any()


def test_the_largest_force_follows_from_the_robot(settled):
    model, hand = settled._model, settled.bystander.hand
    assert Hand(dataclasses.replace(model, stiffness=2.0 * model.stiffness)).force_max == pytest.approx(2.0 * hand.force_max)
    longer = dataclasses.replace(model, length=2.0 * model.length)  # K falls with the cube of the length
    assert Hand(longer).force_max == pytest.approx(hand.force_max / 4.0)


def test_a_wall_pushes_the_robot_without_depth_and_lets_it_back(robot):
    before = robot.truth.tip_position
    robot.bystander.order_wall({"name": "slab", "normal": [1, 0, 0], "point_mm": [1e3 * before[0] + 2.0, 0, 0]}, "virtual/wall")
    for _ in range(8):
        robot.step(0.1)
        assert robot.truth.contact_depth.max(initial=0.0) < DEPTH
    truth = robot.truth
    assert set(truth.contact_obstacle) == {"slab"} and truth.contact_force.sum(axis=0)[0] > 1e-3
    # It touches where the robot's surface is: the tip's face, a radius from the axis.
    assert truth.tip_position[0] - before[0] > 0.004
    np.testing.assert_allclose(truth.contact_place[:, 0], before[0] + 0.002, atol=2 * DEPTH)
    assert truth.wall is not None and truth.wall[0][0] == pytest.approx(before[0] + 0.002)
    robot.bystander.order_wall("clear", "virtual/wall")
    robot.step(2.0)
    assert robot.truth.wall is None and not robot.truth.contact_obstacle
    np.testing.assert_allclose(robot.truth.tip_position, before, atol=4e-4)


def test_a_wall_that_is_put_into_the_robot_comes_in_slowly_and_does_not_crush_it(robot):
    # Sticking at it, the robot cannot slide away.
    robot.bystander.order_wall({"normal": [0, 0, -1], "point_mm": [0, 0, 20], "friction": 1.0}, "virtual/wall")
    forces = []
    for _ in range(6):
        robot.step(0.1)
        forces.append(robot.truth.wall_force)
        assert robot.truth.contact_depth.max(initial=0.0) < DEPTH
    assert robot.unresolved == 0
    # It stops at eight times the hand's largest force; in the last step it compresses the robot by 0.2 mm, which swings.
    step = 2e-3 * robot._model.stiffness[0, 2, 2] / robot.bystander.hand.force_max
    assert 4.0 < max(forces) / robot.bystander.hand.force_max < 8.0 + 2.0 * step
    assert robot.truth.wall[0][2] > 0.09


@pytest.mark.parametrize(
    ("order", "words"),
    [
        ({"normal": [1, 0, 0], "point_mm": [0, 0, 0]}, "cuts the robot's base, which is 4.5 mm inside"),
        ({"normal": [1, 0, 0], "point_mm": [-2e3, 0, 0]}, "2000 mm away; allowed: up to 1000 mm"),
        ({"normal": [0, 0, 0]}, "no direction"),
        ({"point_mm": [float("nan"), 0, 0]}, "a finite number is needed"),
        ({"frame": "world", "point_mm": [-50, 0, 0]}, "needs soft_base"),
        ({"forbidden": True, "point_mm": [-50, 0, 0]}, "only a wall"),
        ({"place": 1}, "unknown key 'place'"),
        ("away", "a mapping of keys is needed"),
    ],
)
def test_a_wrong_wall_is_refused_and_changes_nothing(settled, order, words):
    with pytest.raises(ConfigError, match=f"virtual/wall: .*{words}"):
        settled.bystander.order_wall(order, "virtual/wall")
    assert settled.bystander.plane is None


@pytest.mark.parametrize("order", [{"place_mm": [1, 2]}, {"place_mm": [0, 0, float("inf")]}, "let go", 7])
def test_a_wrong_hand_is_refused_and_changes_nothing(settled, order):
    with pytest.raises(ConfigError, match="virtual/hand"):
        settled.bystander.order_hand(order, "virtual/hand", settled.time)
    assert not settled.bystander.hand.force.any()
