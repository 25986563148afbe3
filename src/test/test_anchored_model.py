"""The model whose tip hangs where the tip was measured: the force that it finds, and its response without the springs."""

import dataclasses

import numpy as np
import pytest

from gravcomp.description import Elements, Payload, load_robot_file
from gravcomp.full_model.payload import with_payload
from gravcomp.full_model.spring import Spring
from gravcomp.full_model.turning_loads import slopes_of
from gravcomp.full_model.wrench import PointLoads, Wrench
from gravcomp.load_estimation import AnchoredModel, AtOnce, LoadEstimationOptions, LoadObserver, at_once
from gravcomp.load_estimation.anchored_follower import Answer
from gravcomp.load_estimation.sensitivity import HeldRobot
from gravcomp.simulation import RobotModel, Simulator

ROBOT = dataclasses.replace(load_robot_file("article").robot, elements=Elements(around=4, along=4))
GRAVITY = np.array([-9.81, 0.0, 0.0])
WOUND = 1e-3 * np.array([1.58, 1.08, 1.10, 1.41, 1.40, 1.43])  # m: nearly straight
FORCE = np.array([-0.03, 0.01, 0.0])  # N: some cables are slack
REST = np.array([0.0, 0.0, ROBOT.length])


@pytest.fixture(scope="module")
def model():
    return RobotModel(ROBOT)


@pytest.fixture(scope="module")
def found(model):
    """A simulator, its shape under the force, and what is found from its tip."""
    simulator, anchored = Simulator(model, reduced=False), AnchoredModel(model)
    pushed = simulator.solve(GRAVITY, WOUND, wrench=Wrench(FORCE))
    assert pushed.is_equilibrium
    anchored.anchor(pushed.tip_position)
    for _ in range(120):
        last = anchored.step(GRAVITY, WOUND, (), 0.01)
    return simulator, pushed, last


def test_the_force_of_a_robot_with_this_tip_is_found(found):
    _, pushed, last = found
    here = HeldRobot(last.shape, last.tip_compliance, WOUND, REST, last.by_loads).under(np.zeros(3))
    force = last.carried + np.linalg.solve(here.tip_force, pushed.tip_position - last.shape.tip_position)
    assert force == pytest.approx(FORCE, abs=0.05 * np.linalg.norm(FORCE))
    assert last.shape.tip_position == pytest.approx(pushed.tip_position, abs=1e-3 * ROBOT.length)
    assert last.shape.cable_tension == pytest.approx(pushed.cable_tension, abs=0.02 * pushed.cable_tension.max())


def test_the_response_is_that_of_the_robot_without_springs(found):
    simulator, _, last = found
    force = last.carried
    here = HeldRobot(last.shape, last.tip_compliance, WOUND, REST, last.by_loads).under(np.zeros(3))
    step = 2e-4  # N: no cable becomes slack
    along = np.array([-1.0, 0.0, 0.2])

    def change(ahead, behind):
        return (ahead.tip_position - behind.tip_position) / 2.0, (ahead.cable_tension - behind.cable_tension) / 2.0

    one, two = (simulator.step(GRAVITY, WOUND, wrench=Wrench(force + sign * step * along)) for sign in (1.0, -1.0))
    tip, tension = change(one, two)
    assert here.tip_force @ along * step == pytest.approx(tip, abs=0.07 * np.abs(tip).max())
    assert here.tension_force @ along * step == pytest.approx(tension, abs=0.07 * np.abs(tension).max())
    # A body with less stress is out of balance by a share of all loads: as if there were more of them.
    share = 2e-3
    one, two = (
        simulator.step((1.0 + sign * share) * GRAVITY, WOUND, wrench=Wrench((1.0 + sign * share) * force)) for sign in (1.0, -1.0)
    )
    tip, _ = change(one, two)
    assert share * here.tip_error == pytest.approx(tip, abs=0.1 * np.abs(tip).max())


def test_a_tip_that_is_bent_beyond_a_right_angle_is_reached_and_its_force_is_of_the_right_size(model):
    """The tip is that of the article's robot of the virtual truth under 0.5 N across it: eight times its weight."""
    tip = np.array([-0.0815, -0.0054, 0.0413])
    anchored = AnchoredModel(model)
    anchored.anchor(tip)
    shapes = [anchored.step(GRAVITY, WOUND, (), 0.01) for _ in range(100)]
    assert shapes[0] is None  # on its way
    last = shapes[-1]
    assert last.shape.tip_position == pytest.approx(tip, abs=0.05 * ROBOT.length)
    assert -0.7 < last.carried[0] < -0.25
    assert np.isfinite(last.tip_compliance).all() and np.linalg.eigvalsh(last.shape.response.compliance_aa).size == 6


def test_the_tangent_of_a_spring_is_its_derivative(model):
    at = np.array([[0.01, -0.02, 0.05], [1.0, 0.1, 0.0], [0.0, 1.0, 0.2]])
    loads = PointLoads.of(model, (Spring(0.6, at, (20.0, 0.01, 0.02)),))
    random = np.random.default_rng(1)
    u, change = (size * random.normal(size=model.mesh.nodes.shape) for size in (1e-3, 1e-6))
    change[model.n_free :] = 0.0
    rows = loads.turning[0][1]
    moved = slopes_of(loads, u, 1.0)[0] @ (rows @ change).ravel()
    difference = (loads.at(u + change) - loads.at(u - change)) / 2.0
    assert model.free(rows.T @ moved.reshape(3, 3)) == pytest.approx(difference, abs=1e-6 * np.abs(difference).max())


def test_the_anchored_model_takes_over_where_the_running_one_is_far_off(model, found):
    simulator, pushed, _ = found
    straight = simulator.solve(GRAVITY, WOUND)
    observer = LoadObserver(ROBOT, LoadEstimationOptions(kind="force"), at_once(model, "force"))
    observer.predict(0.0, straight, np.diag([0.2, 0.2, 1e-3]), np.zeros(3), WOUND)
    observer.measure_tip(0.0, straight.tip_position)
    assert not observer.follow(0.01, straight, WOUND)
    observer.measure_tip(0.01, pushed.tip_position)
    assert np.linalg.norm(pushed.tip_position - straight.tip_position) > 0.1 * ROBOT.length
    for step in range(40):
        assert observer.follow(0.02 + 0.01 * step, straight, WOUND)
    for step in range(40, 60):
        assert observer.follow(0.02 + 0.01 * step, straight, WOUND)
        observer.measure_tip(0.02 + 0.01 * step, pushed.tip_position)
    across = observer.estimate(GRAVITY, 0.62).force[:2]
    assert across == pytest.approx(FORCE[:2], abs=0.15 * np.linalg.norm(FORCE))
    assert at_once(model, "payload") is None


class Follower:
    """A worker that answers every question with the same shape, or with None: on its way."""

    sentence = ""

    def __init__(self, found):
        self.found, self.wanted = found, None

    def exchange(self, question):
        self.wanted = question.place
        return [Answer(question, self.found)]

    def reset(self):
        self.wanted = None

    def close(self):
        pass


def anchored_observer(found, follower, **options):
    """Return an observer whose running model is straight, and has a tip measured there, and that model's shape."""
    straight = found[0].solve(GRAVITY, WOUND)
    looks = LoadObserver(ROBOT, LoadEstimationOptions(kind="force", **options), follower)
    looks.predict(0.0, straight, np.diag([0.2, 0.2, 1e-3]), np.zeros(3), WOUND)
    looks.follow(0.0, straight, WOUND)
    return looks, straight


def test_a_tip_that_moves_is_followed_while_the_anchored_model_is_on_its_way(found):
    follower = Follower(None)
    looks, straight = anchored_observer(found, follower)
    for step in range(80):
        place = straight.tip_position + np.array([-0.02 - 5e-4 * step, 0.0, 0.0])
        looks.measure_tip(0.01 * step, place)
        assert looks.follow(0.01 * step, straight, WOUND)
    assert follower.wanted == pytest.approx(place)
    looks.measure_tip(0.2, straight.tip_position)  # one that is late
    looks.measure_tip(9.0, straight.tip_position)  # one of another clock
    looks.measure_tip(0.8, np.full(3, np.nan))
    assert follower.wanted == pytest.approx(place)


def test_the_estimate_is_kept_and_not_compensated_when_the_tip_is_no_longer_measured(found):
    _, pushed, last = found
    looks, straight = anchored_observer(found, Follower(last), compensate_force=True)
    for step in range(60):
        looks.measure_tip(0.01 * step, pushed.tip_position)
        assert looks.follow(0.01 * step, straight, WOUND)
    before = looks.estimate(GRAVITY, 0.6)
    assert before.force == pytest.approx(last.carried)
    for step in range(60, 460):
        now = 0.01 * step
        if not looks.follow(now, straight, WOUND):
            looks.predict(now, straight, np.diag([0.2, 0.2, 1e-3]), np.zeros(3), WOUND)
        assert looks.wrench(GRAVITY, now).force == pytest.approx(np.zeros(3))
    after = looks.estimate(GRAVITY, now)
    assert "kept" in after.sentence and not after.sources
    assert after.force == pytest.approx(before.force) and after.covariance == pytest.approx(before.covariance)


def test_no_force_is_found_while_the_robot_is_said_to_carry_none(found):
    _, pushed, last = found
    looks, straight = anchored_observer(found, Follower(last))
    looks.zero(0.0)
    for step in range(30):
        looks.measure_tip(0.01 * step, pushed.tip_position)
        looks.follow(0.01 * step, straight, WOUND)
    assert looks.estimate(GRAVITY, 0.3).force == pytest.approx(np.zeros(3))


def test_the_covariance_holds_the_error_of_a_robot_that_is_stiffer_than_its_model(model, found):
    stiff = dataclasses.replace(ROBOT, segments=tuple(_stiffer(one, 1.15) for one in ROBOT.segments))
    pushed = Simulator(RobotModel(stiff), reduced=False).solve(GRAVITY, WOUND, wrench=Wrench(FORCE))
    looks, straight = anchored_observer(found, AtOnce(AnchoredModel(model)))
    for step in range(80):
        looks.measure_tip(0.01 * step, pushed.tip_position)
        looks.follow(0.01 * step, straight, WOUND)
    estimate = looks.estimate(GRAVITY, 0.8)
    error = estimate.force - FORCE
    assert error @ np.linalg.solve(estimate.covariance, error) < 12.0
    assert np.sqrt(np.diag(estimate.covariance)[:2]).max() < 2.0 * np.linalg.norm(FORCE)  # and says something


def test_a_lost_tracker_that_says_zero_is_survived_without_a_search(model, found, monkeypatch):
    _, pushed, _ = found
    anchored = AnchoredModel(model)
    monkeypatch.setattr(anchored._simulator.solver, "solve", lambda *_, **__: pytest.fail("a search takes a second"))
    anchored.anchor(np.zeros(3))
    for _ in range(20):
        anchored.step(GRAVITY, WOUND, (), 0.01)
    anchored.anchor(pushed.tip_position)
    for _ in range(60):
        again = anchored.step(GRAVITY, WOUND, (), 0.01)
    assert again.shape.tip_position == pytest.approx(pushed.tip_position, abs=5e-3 * ROBOT.length)


def test_what_the_loads_move_includes_a_payload_beside_the_tip():
    robot = dataclasses.replace(ROBOT, payload=Payload(0.002, (0.0, 0.0, 0.05)))
    model = RobotModel(robot)
    anchored, slack = AnchoredModel(model), np.full(6, np.nan)
    anchored.anchor(Simulator(model, reduced=False).solve(GRAVITY).tip_position)
    for _ in range(80):
        last = anchored.step(GRAVITY, slack, (), 0.01)
    solver, couple = anchored._simulator.solver, with_payload(model, GRAVITY, None)
    pulls = np.kron(model.section_rows(1.0)[0, : model.n_free, None], np.eye(3))
    loads = model.weight(GRAVITY), couple.at(solver.state.u)
    freed = solver.compliance(np.column_stack([pulls, *loads]), couple)  # without cables the robot is stable without springs
    by_weight, by_couple = freed[:3, 3], freed[:3, 4]
    assert abs(by_couple[0]) > 0.1 * abs(by_weight[0])
    moved = by_weight + by_couple + freed[:3, :3] @ last.carried
    assert last.by_loads[0] == pytest.approx(moved, abs=0.02 * np.linalg.norm(moved))


def _stiffer(segment, factor):
    material = dataclasses.replace(segment.material, youngs_modulus=factor * segment.material.youngs_modulus)
    return dataclasses.replace(segment, material=material)
