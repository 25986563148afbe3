"""The inverse problem keeps its promises on a small robot of constant-curvature segments (arc_robot), in the closed
loop that the graph runs: linear answer -> programme -> displacements -> one Newton step of the model -> next linear
answer."""

import dataclasses

import arc_robot
import numpy as np
import pytest
from arc_robot import LENGTH, LIMITS, STATIONS, ArcRobot, effector

from gravcomp.description import Limits, load_robot_file
from gravcomp.inverse import (
    ControllerCode,
    InverseController,
    InverseOptions,
    Target,
    TargetError,
    bend_target,
    straight_target,
)
from gravcomp.inverse.limits import StepBounds
from gravcomp.inverse.programme import build_programme
from gravcomp.inverse.retreat import Move, Retreat
from gravcomp.inverse.scaling import Programme, scaled, unscaled
from gravcomp.inverse.solver import ProgrammeSolver
from gravcomp.simulation import ShapeStatus, Simulator

GRAVITY = 9.81


def controller(options=InverseOptions(), limits=LIMITS) -> InverseController:
    return InverseController(arc_robot.description(limits), options)


def closed_loop(gravities, target, control=None, robot=None):
    """Runs the loop over the gravities (k, 3); returns robot, displacements (k, 6) and the last command."""
    robot = robot or ArcRobot()
    control = control or controller()
    response = robot.step(gravities[0], None, iterations=20)
    displacements = []
    for gravity in gravities:
        command = control.step(response, target, backbone_station=STATIONS, tension=robot.tension)
        response = robot.step(gravity, command.displacement)
        displacements.append(command.displacement)
    return robot, np.array(displacements), command


def directions(count, seed=0):
    vectors = np.random.default_rng(seed).normal(size=(count, 3))
    return GRAVITY * vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def tip_errors(robot):
    e = effector(robot.q)
    return np.linalg.norm(e[:2]), np.degrees(np.arccos(min(1.0, e[5])))


@pytest.mark.parametrize("gravity", directions(4))
def test_straight_robot_is_held_against_gravity_from_any_direction(gravity):
    robot, _, command = closed_loop([gravity] * 80, straight_target(LENGTH))
    assert tip_errors(robot)[0] < 0.05e-3
    assert command.code == ControllerCode.OK


def test_direction_weight_takes_the_tilt_away():
    target = straight_target(LENGTH, tip_direction_weight=1e-3)
    robot, _, _ = closed_loop(directions(1) * np.ones((80, 1)), target)
    lateral, tilt = tip_errors(robot)
    assert lateral < 0.15e-3 and tilt < 0.3


@pytest.mark.parametrize("gravity", directions(3, seed=4))
def test_cables_of_a_segment_do_not_pull_against_each_other(gravity):
    robot, _, _ = closed_loop([gravity] * 80, straight_target(LENGTH, tip_direction_weight=1e-3))
    assert robot.tension[:3].min() < 1e-3 and robot.tension[3:].min() < 1e-3


def test_bent_shape_is_reached_and_kept_while_gravity_turns():
    target = bend_target(LENGTH, np.radians(60), np.radians(30))
    angles = np.linspace(0.0, np.pi / 2, 160)
    turning = GRAVITY * np.stack([-np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    robot, _, command = closed_loop(np.vstack([turning, [turning[-1]] * 20]), target)
    across = effector(robot.q)[:3] - target.tip_position
    across -= across @ target.tip_direction * target.tip_direction
    assert np.linalg.norm(across) < 0.1e-3
    assert command.code == ControllerCode.OK


@pytest.mark.parametrize("angle, plane", [(1.5, 0.0), (1.5, 0.7), (2.0, 1.57), (2.6, 0.4)])
def test_a_bend_far_from_the_sagging_robot_is_reached(angle, plane):
    """Against gravity and by more than a right angle: the way there is along the target's direction, not away from it."""
    robot = load_robot_file("article").robot
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
    """The full model of the article's robot and its controller, sample by sample; counts searches for a lost equilibrium."""

    def __init__(self, gravity, monkeypatch, law="svk"):
        self.gravity, self.robot = gravity, load_robot_file("article").robot.with_material(law=law)
        self.simulator, self.control = Simulator(self.robot, reduced=False), InverseController(self.robot)
        self.shape, self.searches = self.simulator.step(gravity), 0
        solve = self.simulator.solver.solve
        monkeypatch.setattr(self.simulator.solver, "solve", lambda *a: self._search(solve, a))

    def _search(self, solve, arguments):
        self.searches += 1
        return solve(*arguments)

    def run(self, target, steps):
        """Commands and tips, one a step."""
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
    "law, gravity, far",
    [
        ("svk", [0.0, 0.0, -GRAVITY], bend_target(0.1, 4.5, 0.0, tip_direction_weight=1e-3)),
        ("svk", [-GRAVITY, 0.0, 0.0], Target(np.array([0.0, 0.02, -0.05]))),
        ("svk", [0.0, GRAVITY, 0.0], Target(np.zeros(3))),
        ("neo_hookean", [0.0, 0.0, -GRAVITY], Target(np.array([0.0, 0.02, -0.05]))),
    ],
    ids=["rolled up", "behind the base", "in the base", "behind the base, neo-Hookean"],
)
def test_a_target_that_no_shape_reaches_is_come_near_to_and_left_again(law, gravity, far, monkeypatch):
    """On the way there, or back, the equilibria end; the loop stays where they do and finds another way, without a search."""
    loop = ModelLoop(gravity, monkeypatch, law)
    commands, tips = loop.run(far, 400)
    assert np.ptp(tips[-50:], axis=0).max() < 8e-3 and commands[-1].code in (ControllerCode.UNREACHABLE, ControllerCode.OK)
    there = np.linalg.norm(loop.shape.tip_position - [0.0, 0.0, 0.1])
    assert there > 0.1
    back, tips = loop.run(straight_target(0.1, tip_direction_weight=1e-3), 450)
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


def test_cables_are_paid_out_where_the_model_does_not_follow_back_either():
    control, target = controller(), bend_target(LENGTH, 1.0, 0.0)
    robot, _, before = closed_loop([np.array([-GRAVITY, 0.0, 0.0])] * 40, target, control)
    response = robot.step([-GRAVITY, 0.0, 0.0], before.displacement)
    lost = [control.step(response, target, backbone_station=STATIONS, tension=robot.tension, followed=False) for _ in range(6)]
    assert lost[-1].code == ControllerCode.RELAXING and "no equilibrium" in lost[-1].message
    taut = robot.tension > 0.1
    assert (lost[-1].displacement < lost[0].displacement - 1e-3)[taut].all()


def moves_at_a_dead_end(sag, missed, steps=400):
    """Moves of a robot that hangs by `sag` (m) without tension, and then stays `missed` (m) beside the straight target under 4 N; paying out
    takes 0.1 N a step from the tension, steps onward bring it back at once."""
    retreat, target, tension = Retreat(LENGTH), straight_target(LENGTH), np.full(6, 4.0)
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


def test_a_target_at_a_dead_end_is_tried_again_three_times_from_nearer_to_rest_each():
    moves = moves_at_a_dead_end(sag=0.3 * LENGTH, missed=LENGTH)
    paid_out = [len(run) for run in "".join("P" if move == Move.PAY_OUT else " " for move in moves).split()]
    assert paid_out == [20, 30, 40]


def test_a_load_that_is_too_heavy_is_held_and_not_dropped():
    assert set(moves_at_a_dead_end(sag=0.6 * LENGTH, missed=0.5 * LENGTH)) == {Move.ONWARD}


def test_backbone_weight_straightens_the_middle():
    gravities = [np.array([-GRAVITY, 0.0, 0.0])] * 80
    middle = slice(6 + 3 * 4, 6 + 3 * 4 + 2)
    tip_alone, _, _ = closed_loop(gravities, straight_target(LENGTH))
    with_middle, _, _ = closed_loop(gravities, straight_target(LENGTH, backbone_station=[0.5], backbone_weight=[1.0]))
    assert np.linalg.norm(effector(with_middle.q)[middle]) < 0.2 * np.linalg.norm(effector(tip_alone.q)[middle])


@pytest.mark.parametrize(
    "target", [Target(np.array([0.06, 0.03, 0.12])), Target(np.array([-0.15, 0.0, 0.0])), bend_target(LENGTH, 5.0, 0.3)]
)
def test_infeasible_target_settles_at_the_nearest_shape_and_says_so(target):
    limits = dataclasses.replace(LIMITS, tension_max=2.0)
    robot, displacements, command = closed_loop([np.array([-GRAVITY, 0.0, 0.0])] * 300, target, controller(limits=limits))
    assert np.abs(np.diff(displacements[-40:], axis=0)).max() < 2e-6
    assert command.code == ControllerCode.UNREACHABLE
    distance = np.linalg.norm(effector(robot.q)[:3] - target.tip_position)
    assert command.distance == pytest.approx(distance, rel=0.02)
    assert f"{1e3 * command.distance:.1f} mm" in command.message


def test_limits_and_rates_are_never_left():
    limits = Limits(tension_max=0.3, displacement_min=-1e-3, displacement_max=1e-3, displacement_rate=0.02)
    control = controller(limits=limits)
    gravities = np.repeat(directions(6, seed=2), 30, axis=0)
    _, displacements, command = closed_loop(gravities, bend_target(LENGTH, 1.0, 0.0), control)
    assert np.abs(displacements).max() <= 1e-3
    assert np.abs(np.diff(displacements, axis=0)).max() <= 0.02 * 0.01 + 1e-12
    assert command.tension.max() <= 0.3
    assert command.code in (ControllerCode.AT_LIMIT, ControllerCode.UNREACHABLE) and "s" in command.message


def test_rate_limit_is_named_while_moving():
    slow = dataclasses.replace(LIMITS, displacement_rate=0.002)
    _, _, command = closed_loop([np.array([-GRAVITY, 0.0, 0.0])] * 4, straight_target(LENGTH), controller(limits=slow))
    assert command.code == ControllerCode.AT_LIMIT
    assert "displacement rate" in command.message


def test_slack_is_entered_and_left_without_chatter():
    # Two turns about the robot's axis, 90 deg/s: each cable goes idle and comes back, at changing partners, several times a turn.
    angles = np.linspace(0.0, 4 * np.pi, 800)
    turning = GRAVITY * np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    robot, displacements, _ = closed_loop(turning, straight_target(LENGTH))
    velocity = np.diff(displacements[100:], axis=0)
    back_and_forth = (velocity[2:] * velocity[1:-1] < 0.0) & (velocity[1:-1] * velocity[:-2] < 0.0)
    assert not back_and_forth.any()
    # A jump by the slack of 0.1 mm would show: the motion itself makes 17 um a step at most.
    assert np.abs(velocity).max() < 0.03e-3


def test_no_drift_under_constant_gravity():
    _, displacements, _ = closed_loop([np.array([-7.0, 3.0, -6.0])] * 500, straight_target(LENGTH))
    assert np.abs(displacements[-1] - displacements[-200]).max() < 1e-7


def test_pretension_keeps_every_cable_taut():
    control = controller(InverseOptions(pretension=0.02))
    robot, _, _ = closed_loop([np.array([-GRAVITY, 0.0, 0.0])] * 80, straight_target(LENGTH), control)
    assert robot.tension.min() > 0.019


def test_same_inputs_give_the_same_bits():
    gravities = np.repeat(directions(3, seed=7), 20, axis=0)
    first = closed_loop(gravities, straight_target(LENGTH))[1]
    second = closed_loop(gravities, straight_target(LENGTH))[1]
    assert np.array_equal(first, second)


def test_broken_answer_keeps_the_last_command_and_recovers():
    robot, control, gravity = ArcRobot(), controller(), np.array([-GRAVITY, 0.0, 0.0])
    response = robot.step(gravity, None, iterations=10)
    good = control.step(response, straight_target(LENGTH), backbone_station=STATIONS, tension=robot.tension)
    response.effector_free = response.effector_free * np.nan
    broken = control.step(response, straight_target(LENGTH), backbone_station=STATIONS, tension=robot.tension)
    assert broken.code == ControllerCode.SOLVER_FAILED
    assert np.array_equal(broken.displacement, good.displacement)
    again = control.step(robot.response(gravity), straight_target(LENGTH), backbone_station=STATIONS, tension=robot.tension)
    assert again.code != ControllerCode.SOLVER_FAILED


def test_relaxing_pays_the_cables_out_at_the_allowed_rate():
    robot, control, gravity = ArcRobot(), controller(), np.array([-GRAVITY, 0.0, 0.0])
    closed_loop([gravity] * 60, straight_target(LENGTH), control, robot)
    displacements = []
    for _ in range(60):
        command = control.relax(robot.response(gravity))
        displacements.append(command.displacement)
        robot.step(gravity, command.displacement)
    assert command.code == ControllerCode.RELAXING
    assert np.abs(np.diff(displacements, axis=0)).max() <= 0.05 * 0.01 + 1e-12
    assert robot.tension.max() == 0.0


def solved(solver, programme):
    """The tensions (m,) of the programme."""
    parts = scaled(programme)
    solution = solver.solve(parts)
    return unscaled(solution.unknowns, solution.multipliers, parts.scale, parts.tension_lower, parts.tension_upper)[0]


def test_solution_satisfies_the_optimality_conditions():
    rng = np.random.default_rng(3)
    solver = ProgrammeSolver()
    for _ in range(30):
        root = rng.normal(size=(6, 6))
        compliance = 1e-3 * (root @ root.T + np.eye(6))
        jacobian, missed = 0.03 * rng.normal(size=(8, 6)), 0.01 * rng.normal(size=8)
        bounds = StepBounds(np.full(6, -4e-3), np.full(6, 4e-3), np.zeros(6), np.full(6, 0.5))
        programme = Programme(2 * jacobian.T @ jacobian, 2 * jacobian.T @ missed, compliance, np.zeros(6), bounds)
        tension = solved(solver, programme)
        slope = programme.hessian @ tension + programme.gradient
        # The elastic bounds give by about a micrometre at most.
        assert np.abs(compliance @ tension).max() < 4e-3 + 2e-6
        for other in rng.uniform(0.0, 0.5, size=(2000, 6)):
            if np.abs(compliance @ other).max() < 4e-3:  # a feasible point: the cost does not fall toward it
                assert slope @ (other - tension) > -1e-3 * np.linalg.norm(slope) * np.linalg.norm(other - tension)


def test_bounds_that_cannot_be_kept_together_are_missed_by_the_least():
    """After a jump of gravity a path may be longer than its winch allows, whatever the tension."""
    solver = ProgrammeSolver()
    compliance = 1e-3 * np.array([[2.0, 0.5], [0.5, 2.0]])
    hessian, gradient = 2e-6 * np.eye(2), np.array([-1e-7, -1e-7])
    bounds = StepBounds(np.array([3e-3, -9e-3]), np.full(2, 9e-3), np.zeros(2), np.full(2, 1.0))
    kept = solved(
        solver,
        Programme(hessian, gradient, compliance, np.zeros(2), StepBounds(-np.ones(2), np.ones(2), np.zeros(2), np.ones(2))),
    )
    assert kept == pytest.approx([0.05, 0.05], abs=1e-5)
    for _ in range(2):
        missed = solved(solver, Programme(hessian, gradient, compliance, np.zeros(2), bounds))
        assert missed == pytest.approx([1.0, 1.0], abs=1e-3)  # 2.5 mm of the 3 mm asked for
    again = solved(
        solver,
        Programme(hessian, gradient, compliance, np.zeros(2), StepBounds(-np.ones(2), np.ones(2), np.zeros(2), np.ones(2))),
    )
    assert again == pytest.approx(kept, abs=1e-5)


def test_weights_are_the_squares_of_the_rows():
    # The programme's cost equals the sum of its meaning, evaluated term by term.
    robot, gravity = ArcRobot(), np.array([-GRAVITY, 0.0, 0.0])
    response = robot.step(gravity, None, iterations=20)
    target = straight_target(LENGTH, tip_direction_weight=1e-3, backbone_station=[0.3], backbone_weight=[0.7])
    options = InverseOptions(energy_weight=1e-6, proximal_weight=0.0, axial_weight=0.25)
    zeros = np.zeros(6)
    programme = build_programme(
        response,
        target,
        Limits(),
        tension=zeros,
        displacement=zeros,
        backbone_station=STATIONS,
        interval=0.01,
        damping=1.0,
        options=options,
    )

    def cost(tension):
        e = response.compliance_ea @ tension + response.effector_free
        tip = e[:3] - [0, 0, LENGTH]
        point = [np.interp(0.3, STATIONS, e[6 + k :: 3]) for k in range(3)] - np.array([0, 0, 0.3 * LENGTH])
        along = response.effector_free[6 + 9 : 6 + 12] - response.effector_free[6 + 6 : 6 + 9]
        axial = point @ along / np.linalg.norm(along)
        middle = 0.7 * (point @ point - 0.75 * axial**2)
        towards = response.effector_free[3:6]
        along_target = (1.0 - 0.5 * (towards[2] / np.linalg.norm(towards)) ** 2) ** 2  # 0.25 for a tip that points there
        return tip[:2] @ tip[:2] + along_target * tip[2] ** 2 + 1e-3 * np.sum((e[3:6] - [0, 0, 1]) ** 2) + middle

    tension = np.array([0.1, 0.2, 0.0, 0.3, 0.0, 0.1])
    x = tension / programme.scale
    quadratic = 2e-6 * (0.5 * x @ programme.hessian @ x + programme.gradient @ x)  # its cost is in mm^2, halved
    assert quadratic == pytest.approx(cost(tension) - cost(np.zeros(6)), rel=1e-3)


def test_arc_has_its_length_and_ends_in_its_direction():
    target = bend_target(0.1, 1.2, 0.7, backbone_station=np.linspace(0, 1, 2001), backbone_weight=np.ones(2001))
    steps = np.diff(target.backbone_position, axis=0)
    assert np.linalg.norm(steps, axis=1).sum() == pytest.approx(0.1, rel=1e-6)
    assert steps[-1] / np.linalg.norm(steps[-1]) == pytest.approx(target.tip_direction, abs=1e-3)
    assert target.backbone_position[-1] == pytest.approx(target.tip_position)


@pytest.mark.parametrize(
    "arguments, said",
    [
        (dict(tip_position=[0, 0]), "tip_position has the shape (2,)"),
        (dict(tip_position=[0, 0, np.nan]), "finite"),
        (dict(tip_position=[0, 0, 1], tip_direction=[0, 0, 0]), "length 0"),
        (dict(tip_position=[0, 0, 1], tip_position_weight=-1.0), "at least 0"),
        (dict(tip_position=[0, 0, 1], tip_position_weight=0.0), "every weight is 0"),
        (dict(tip_position=[0, 0, 1], tip_direction_weight=1.0), "without a tip_direction"),
        (
            dict(tip_position=[0, 0, 1], backbone_station=[1.5], backbone_position=[[0, 0, 1]], backbone_weight=[1]),
            "0 (base) to 1 (tip)",
        ),
        (
            dict(tip_position=[0, 0, 1], backbone_station=[0.5], backbone_position=[[0, 0, 1]], backbone_weight=[]),
            "backbone_weight",
        ),
    ],
)
def test_unusable_target_is_refused_with_a_reason(arguments, said):
    with pytest.raises(TargetError, match=said.replace("(", r"\(").replace(")", r"\)")):
        Target(**arguments)


@pytest.mark.parametrize(
    "arguments, said",
    [
        (dict(tip_position=[0, 0, 100.0]), "tip_position is 100 m from the base"),  # millimetres
        (
            dict(tip_position=[0, 0, 0.1], backbone_station=[0.5], backbone_position=[[0, 1, 0]], backbone_weight=[1]),
            "backbone_position 0 is 1 m",
        ),
    ],
)
def test_points_out_of_any_reach_are_refused(arguments, said):
    with pytest.raises(TargetError, match=f"{said}.*up to 0.15 m"):
        Target(**arguments).check_reach(0.1)


def test_points_without_weight_or_hardly_out_of_reach_are_asked_for():
    Target([0, 0, 9.0], tip_position_weight=0.0, tip_direction=[0, 0, 1], tip_direction_weight=1.0).check_reach(0.1)
    Target([0, 0, 0.12]).check_reach(0.1)


def test_codes_are_those_of_the_message():
    names = {code.name: code.value for code in ControllerCode}
    message = (arc_robot_root() / "gravcomp_msgs" / "msg" / "ControllerStatus.msg").read_text()
    lines = [line.split("#")[0].removeprefix("uint8 ") for line in message.splitlines()]
    constants = dict(line.split("=") for line in lines if "=" in line)
    assert {k.strip(): int(v) for k, v in constants.items()} == names


def arc_robot_root():
    from pathlib import Path

    return Path(arc_robot.__file__).resolve().parents[2]
