"""Targets that are far away or out of reach: the loop finds a way to them or stops near them, and recovers afterwards."""

import dataclasses

import numpy as np
import pytest
from arc_robot import LENGTH, LIMITS, STATIONS, ArcRobot, closed_loop, controller
from coarse_article import coarse

from gravcomp.description.rest_shape import RestShape
from gravcomp.inverse import ControllerCode, InverseController, Target, bend_target, straight_target
from gravcomp.inverse.retreat import Move, Retreat
from gravcomp.mesh.robot_axis import rest_tip
from gravcomp.simulation import ShapeStatus, Simulator

GRAVITY = 9.81
STRAIGHT = np.array([0.0, 0.0, LENGTH])


@pytest.mark.parametrize(("angle", "plane"), [(1.5, 0.0), (1.5, 0.7), (2.0, 1.57), (2.6, 0.4)])
def test_a_bend_far_from_the_sagging_robot_is_reached(angle, plane):
    """Against gravity and by more than a right angle: the tip has to move along the target's direction."""
    robot = coarse()
    simulator, control, target = (
        Simulator(robot, reduced=False),
        InverseController(robot),
        bend_target(robot.length, angle, plane),
    )
    displacement = None
    for _ in range(250):
        shape = simulator.step([-GRAVITY, 0.0, 0.0], displacement)
        assert shape.status == ShapeStatus.OK
        command = control.step(shape.response, target, backbone_station=shape.backbone_station, tension=shape.cable_tension)
        displacement = command.displacement
    assert np.linalg.norm(shape.tip_position - target.tip_position) < 3e-3


class ModelLoop:
    """The coarse full model of the article's robot and its controller in the closed loop; counts searches for an equilibrium."""

    def __init__(self, gravity, monkeypatch, law="svk"):
        self.gravity, self.robot = gravity, coarse().with_material(law=law)
        self.simulator, self.control = Simulator(self.robot, reduced=False), InverseController(self.robot)
        self.shape, self.searches = self.simulator.step(gravity), 0
        solve = self.simulator.solver.solve
        monkeypatch.setattr(self.simulator.solver, "solve", lambda *a: self._search(solve, a))

    def _search(self, solve, arguments):
        self.searches += 1
        return solve(*arguments)

    def run(self, target, steps):
        """Commands and tips, one per step."""
        commands, tips = [], []
        for _ in range(steps):
            shape = self.shape
            commands.append(
                self.control.step(
                    shape.response,
                    target,
                    backbone_station=shape.backbone_station,
                    tension=shape.cable_tension,
                    followed=shape.is_equilibrium,
                )
            )
            self.shape = self.simulator.step(self.gravity, commands[-1].displacement)
            tips.append(self.shape.tip_position)
        return commands, np.array(tips)


@pytest.mark.parametrize(
    ("law", "gravity", "far"),
    [
        ("svk", [0.0, 0.0, -GRAVITY], bend_target(0.1, 4.5, 0.0, tip_direction_weight=1e-3)),
        ("svk", [-GRAVITY, 0.0, 0.0], Target(np.array([0.0, 0.02, -0.05]))),
        ("svk", [0.0, GRAVITY, 0.0], Target(np.zeros(3))),
        ("neo_hookean", [0.0, 0.0, -GRAVITY], Target(np.array([0.0, 0.02, -0.05]))),
    ],
    ids=["rolled up", "behind the base", "in the base", "behind the base, neo-Hookean"],
)
def test_the_loop_stops_near_a_target_out_of_reach_and_recovers_from_it(law, gravity, far, monkeypatch):
    """On the way there or back the branch of equilibria ends; the loop stays there and finds another way, without a search."""
    loop = ModelLoop(gravity, monkeypatch, law)
    commands, tips = loop.run(far, 240)
    assert np.ptp(tips[-50:], axis=0).max() < 8e-3 and commands[-1].code in (ControllerCode.UNREACHABLE, ControllerCode.OK)
    there = np.linalg.norm(loop.shape.tip_position - [0.0, 0.0, 0.1])
    assert there > 0.1
    back, tips = loop.run(straight_target(0.1, tip_direction_weight=1e-3), 300)
    assert np.linalg.norm(tips[-1] - [0.0, 0.0, 0.1]) < 2e-3 and back[-1].code == ControllerCode.OK
    assert loop.searches == 0
    moved = np.abs(np.diff([command.displacement for command in commands + back], axis=0))
    assert moved.max() <= loop.robot.limits.displacement_rate * 0.01 + 1e-9


def test_a_command_that_was_not_followed_is_taken_back_and_strides_become_short():
    control, target = controller(), bend_target(LENGTH, 1.0, 0.0)
    robot = ArcRobot()
    response = robot.step([-GRAVITY, 0.0, 0.0], None, iterations=20)
    commands = []
    for _ in range(5):
        commands.append(control.step(response, target, backbone_station=STATIONS, tension=robot.tension))
        response = robot.step([-GRAVITY, 0.0, 0.0], commands[-1].displacement)
    usual = np.abs(commands[-1].displacement - commands[-2].displacement).max()
    back = control.step(response, target, backbone_station=STATIONS, tension=robot.tension, followed=False)
    path = response.compliance_aa @ robot.tension + response.displacement_free
    taut = robot.tension > 0.0
    assert np.allclose(back.displacement[taut], path[taut]) and (back.displacement[~taut] < path[~taut]).all()
    assert back.code == ControllerCode.UNREACHABLE
    again = control.step(response, target, backbone_station=STATIONS, tension=robot.tension, followed=True)
    assert 0.0 < np.abs(again.displacement - back.displacement).max() < 0.3 * usual


def test_cables_are_paid_out_if_the_model_does_not_follow_back_either():
    control, target = controller(), bend_target(LENGTH, 1.0, 0.0)
    robot, _, before = closed_loop([np.array([-GRAVITY, 0.0, 0.0])] * 40, target, control)
    response = robot.step([-GRAVITY, 0.0, 0.0], before.displacement)
    lost = [control.step(response, target, backbone_station=STATIONS, tension=robot.tension, followed=False) for _ in range(6)]
    assert lost[-1].code == ControllerCode.RELAXING and "no equilibrium" in lost[-1].message
    taut = robot.tension > 0.1
    assert (lost[-1].displacement < lost[0].displacement - 1e-3)[taut].all()


def moves_at_a_dead_end(sag, missed, steps=400):
    """Moves of a robot that sags by `sag` (m) without tension, and then stays `missed` (m) off the straight target under 4 N.

    Paying out reduces the tension by 0.1 N per step; a step onward restores it.
    """
    retreat, target, tension = Retreat(LENGTH, LIMITS.tension_max, STRAIGHT), straight_target(LENGTH), np.full(6, 4.0)
    retreat.move(True, target, np.array([-sag, 0.0, LENGTH]), np.zeros(6))
    moves = []
    for _ in range(steps):
        moves.append(retreat.move(True, target, np.array([missed, 0.0, LENGTH]), tension))
        if moves[-1] == Move.PAY_OUT:
            tension = np.maximum(tension - 0.1, 0.0)
        else:
            tension = np.full(6, 4.0)
            retreat.observe(np.zeros(6), 0.01)
    return moves


def test_a_target_at_a_dead_end_is_tried_again_from_half_a_quarter_and_no_tension():
    moves = moves_at_a_dead_end(sag=0.3 * LENGTH, missed=LENGTH)
    paid_out = [len(run) for run in "".join("P" if move == Move.PAY_OUT else " " for move in moves).split()]
    assert paid_out == [20, 30, 40]


def test_a_robot_bent_at_rest_is_not_paid_out_towards_the_straight_one():
    """Not yet released, it knows where its shape at rest has the tip: farther from the target than where it is stuck."""
    target, bent = straight_target(LENGTH), np.array([0.9 * LENGTH, 0.0, 0.3 * LENGTH])
    moves = []
    for at_rest in (STRAIGHT, bent):
        retreat = Retreat(LENGTH, LIMITS.tension_max, at_rest)
        for _ in range(60):
            moves.append(retreat.move(True, target, np.array([0.5 * LENGTH, 0.0, LENGTH]), np.full(6, 4.0)))
            retreat.observe(np.zeros(6), 0.01)
    assert Move.PAY_OUT in moves[:60] and set(moves[60:]) == {Move.ONWARD}
    robot = coarse()
    rest = RestShape(bend_angle=np.radians(60.0))
    hook = dataclasses.replace(robot, segments=tuple(dataclasses.replace(one, rest=rest) for one in robot.segments))
    assert np.allclose(InverseController(hook)._retreat._tip_at_rest, rest_tip(hook)[0]) and rest_tip(hook)[0][0] > 0.3 * LENGTH


def test_a_load_that_is_too_heavy_is_held_and_not_dropped():
    assert set(moves_at_a_dead_end(sag=0.6 * LENGTH, missed=0.5 * LENGTH)) == {Move.ONWARD}
