"""External loads while the robot runs: wrenches, payloads, tension sensors, and what is found of an unknown load."""

import collections
import dataclasses

import numpy as np
import pytest

from gravcomp.config import ConfigError
from gravcomp.description import Elements, MaxWrench, Payload, load_robot_file
from gravcomp.external_loads import ExternalLoadOptions, LivePayload, WrenchInput, holdable_payload
from gravcomp.full_model.shape import Response, Shape
from gravcomp.load_estimation import LoadEstimationOptions, LoadObserver
from gravcomp.load_estimation.load_filter import LoadFilter
from gravcomp.load_estimation.needed_force import NeededForce
from gravcomp.load_estimation.sensitivity import HeldRobot
from gravcomp.load_estimation.tension_check import TensionCheck
from gravcomp.simulation import Simulator

ROBOT = dataclasses.replace(load_robot_file("article").robot, max_wrench=MaxWrench(0.5, 0.01))
GRAVITY = np.array([-9.81, 0.0, 0.0])
ZERO = np.zeros(3)
REST = np.array([0.0, 0.0, 0.1])  # m, tip of `shape` at rest


def taken(**changes):
    values = {"stamp": 10.0, "now": 10.0, "frame": "soft_tip", "force": np.array([0.1, 0, 0]), "moment": ZERO} | changes
    source = WrenchInput(changes.pop("robot", ROBOT), ExternalLoadOptions())
    values.pop("robot", None)
    source.take(**values)
    return source


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"frame": "map"}, "frame 'map', which is not known; allowed: soft_base, soft_tip"),
        ({"force": np.array([1e4, 0, 0])}, "its force is 1e+04 N; robot.max_wrench.force allows 0.5 N"),
        ({"moment": np.array([0, 0, 1.0])}, "its moment is 1 N m"),
        ({"force": np.array([np.nan, 0, 0])}, "finite numbers are needed"),
        ({"stamp": 8.0}, "it is 2.00 s old"),
        ({"stamp": 11.0}, "ahead"),
        ({"stamp": 0.0}, "no stamp"),
        ({"robot": dataclasses.replace(ROBOT, max_wrench=None)}, "no robot.max_wrench"),
    ],
)
def test_wrenches_that_cannot_be_used_are_refused_with_the_reason(changes, reason):
    source = taken(**changes)
    assert reason in source.refusal
    assert not source.wrenches(10.1)


def test_the_frame_says_where_a_wrench_acts_and_whether_it_turns():
    for frame, station, follower in (("soft_tip", 1.0, True), ("soft_base", 1.0, False), ("soft_base_backbone_5", 0.5, True)):
        (wrench,) = taken(frame=frame).wrenches(10.0)
        assert (wrench.station, wrench.follower) == (pytest.approx(station), follower)


def test_a_wrench_comes_slowly_and_goes_when_it_is_stale():
    source = taken()
    source.wrenches(10.0)
    size = [source.wrenches(10.0 + 0.01 * k)[0].force[0] for k in range(1, 50)]
    assert 0.0 < size[0] < 0.05 * 0.1 and size[-1] > 0.07
    assert np.all(np.diff(size) > 0.0)
    for k in range(1000):
        left = source.wrenches(10.5 + 0.01 * k)
    assert not left
    assert not source.sentence


def test_a_payload_that_breaks_the_robot_is_refused_and_another_one_is_ramped():
    payload = LivePayload(ROBOT, ramp_time=0.3)
    for mass in (10.0, -0.001, np.nan):
        with pytest.raises(ConfigError, match=r"payload\.mass_g"):
            payload.set(mass)
    payload.set(0.004)
    payload.wrench(GRAVITY, 0.0)
    weights = [payload.wrench(GRAVITY, 0.1 * k).force[0] for k in range(1, 30)]
    assert np.all(np.diff(weights) < 0.0) and weights[-1] == pytest.approx(-9.81 * 0.004, rel=1e-3)


def test_a_payload_that_the_cables_cannot_hold_is_refused():
    simulator = Simulator(dataclasses.replace(ROBOT, elements=Elements(around=4, along=4)), reduced=False)
    straight = simulator.step(np.zeros(3), np.zeros(6))
    most = holdable_payload(straight, simulator.tip_compliance(), ROBOT.limits.tension_max)
    # A beam: F l^3 / 3 EI = M_distal l^2 / 2 EI + M_proximal 3 l^2 / 8 EI; against the worst direction, M = T r cos 30 deg.
    moment = 5.0 * 3.15e-3 * np.cos(np.radians(30.0))
    assert 9.81 * most == pytest.approx(3.0 * moment * (1 / 2 + 3 / 8) / ROBOT.length, rel=0.05)
    payload = LivePayload(ROBOT, 0.0, most)
    payload.set(0.95 * most)
    with pytest.raises(ConfigError, match="the cables hold at most"):
        payload.set(1.05 * most)
    heavy = dataclasses.replace(ROBOT, payload=Payload(2.0 * most))
    LivePayload(heavy, 0.0, most).set(2.0 * most)


@pytest.mark.parametrize(
    ("reading", "expected", "reason"),
    [
        (lambda t, noise: -t + noise, 1.0, "wrong sign"),
        (lambda t, noise: np.full(6, 0.7), 1.0, "stuck"),
        (lambda t, noise: 0.5 + noise, 0.0, "not zeroed"),
        (lambda t, noise: 1e3 * t + noise, 1.0, "its unit"),
        (lambda t, noise: t[:3], 1.0, "3 tensions for 6 cables"),
        (lambda t, noise: t * np.nan, 1.0, "not a finite number"),
        (lambda t, noise: t + noise, 1.0, ""),
        (lambda t, noise: np.abs(noise), 0.0, ""),
    ],
)
def test_tension_sensors_that_cannot_be_right_are_named(reading, expected, reason):
    check, random = TensionCheck(ROBOT.cable_names, 5.0, 0.05), np.random.default_rng(1)
    said = {check.observe(reading(np.full(6, expected), 0.01 * random.normal(size=6)), np.full(6, expected)) for _ in range(120)}
    if reason:
        assert any(reason in sentence for sentence in said)
    else:
        assert said == {""}


def test_a_sensor_of_a_taut_cable_that_is_not_zeroed_is_named_where_the_robot_carries_nothing():
    check, random = TensionCheck(ROBOT.cable_names, 5.0, 0.05), np.random.default_rng(1)
    expected = np.full(6, 0.5)

    def said(unloaded, offset=0.8):
        zeros = np.array([offset, 0, 0, 0, 0, 0])
        return [check.observe(expected + zeros + 0.01 * random.normal(size=6), expected, unloaded) for _ in range(120)][-1]

    assert said(False) == ""  # it may be a load
    assert "not zeroed" in said(True) and "s1c1" in said(True)
    assert "not zeroed" in said(False)
    assert said(True, 0.0) == "" and said(False, 0.0) == ""


@pytest.fixture
def shape():
    """A straight robot of one segment with three cables around it, linear: 2 mm/N of the tip, and its own weight."""
    angle = 2 * np.pi * np.arange(3) / 3
    lever = np.column_stack([np.cos(angle), np.sin(angle), np.full(3, -0.02)])  # m of cable per m of the tip
    tip = np.diag([0.8, 0.8, 0.002])
    to_tip = tip @ lever.T
    compliance = lever @ tip @ lever.T + 1e-4 * np.eye(3)
    weight = 0.01 * GRAVITY
    free, tension = to_tip.T @ weight, np.array([0.3, 0.1, 0.1])
    response = Response(
        compliance, np.vstack([to_tip, np.zeros((3, 3))]), free, np.append(tip @ weight + [0, 0, 0.1], np.zeros(3))
    )
    place = response.effector_free[:3] + to_tip @ tension
    empty = np.zeros((0, 3))
    tip = tip + np.diag([0.4, 0.4, 0.0])  # what the cables do not hold
    return tip, Shape(
        place, np.array([0, 0, 0, 1.0]), np.zeros(0), empty, empty, compliance @ tension + free, tension, GRAVITY, response, 0.0
    )


def test_derivatives_of_a_held_robot_are_those_of_its_tensions_and_tip(shape):
    tip, shape = shape
    robot = HeldRobot(shape, tip, shape.cable_displacement, REST)
    at, h = np.array([0.01, -0.02, 0.005]), 1e-6
    here = robot.under(at)
    for axis in range(3):
        ahead, behind = robot.under(at + h * np.eye(3)[axis]), robot.under(at - h * np.eye(3)[axis])
        assert here.tip_force[:, axis] == pytest.approx((ahead.tip - behind.tip) / (2 * h), abs=1e-6)
        assert here.tension_force[:, axis] == pytest.approx((ahead.tension - behind.tension) / (2 * h), abs=1e-5)
    # Cables that a load makes slack do not push.
    slackened = robot.under(np.array([-1.0, 0, 0]))
    assert slackened.taut.tolist() == [True, False, False]
    assert shape.cable_tension + slackened.tension == pytest.approx([1.2, 0, 0], abs=0.01)


def test_nothing_is_learnt_while_the_model_has_no_equilibrium(shape):
    """Measurements of a robot that has moved on do not belong to the last shape of the model."""
    tip, shape = shape
    robot = dataclasses.replace(ROBOT, cables=ROBOT.cables[:3])
    observer = LoadObserver(robot, LoadEstimationOptions(kind="force"))
    for k in range(10):
        observer.predict(0.01 * k, shape, tip, ZERO, shape.cable_displacement)
        observer.measure_tip(0.01 * k, shape.tip_position + 1e-3 * np.eye(3)[1])
    found = observer.estimate(GRAVITY, 0.1)
    assert found.force[1] > 0.0 and not found.sentence
    for k in range(100):
        observer.measure_tip(0.5 + 0.1 * k, shape.tip_position + 0.05 * np.eye(3)[1])
        observer.measure_tensions(0.5 + 0.1 * k, 3.0 * shape.cable_tension)
    kept = observer.estimate(GRAVITY, 10.5)
    assert kept.force == pytest.approx(found.force) and "finds no equilibrium" in kept.sentence


@pytest.mark.parametrize("sources", ["tip", "tensions", "both"])
def test_a_payload_is_found_after_zeroing_whatever_the_models_errors(shape, sources):
    """The true robot is 20 % softer than the model; both are linear, so that the rest of the error is noise."""
    tip, shape = shape
    robot = dataclasses.replace(ROBOT, cables=ROBOT.cables[:3])
    observer = LoadObserver(robot, LoadEstimationOptions(kind="payload", compensate=False))
    random, mass, wound = np.random.default_rng(2), 0.004, shape.cable_displacement
    soft = dataclasses.replace(
        shape,
        response=dataclasses.replace(
            shape.response,
            compliance_aa=1.2 * shape.response.compliance_aa,
            compliance_ea=1.2 * shape.response.compliance_ea,
            displacement_free=1.2 * shape.response.displacement_free,
            effector_free=1.2 * (shape.response.effector_free - [0, 0, 0.1, 0, 0, 0]) + [0, 0, 0.1, 0, 0, 0],
        ),
    )
    truth, start = HeldRobot(soft, 1.2 * tip, wound, REST), soft.response.effector_free[:3]
    for k in range(300):
        now, carried = 0.04 * k, mass * GRAVITY * (k >= 150)
        observer.predict(now, shape, tip, ZERO, wound)
        if k == 50:
            observer.zero(now)
        here = truth.under(carried)
        tension = soft.cable_tension + here.tension
        if sources != "tip":
            observer.measure_tensions(now, tension * (1 + 0.01 * random.normal(size=3)))
        if sources != "tensions" and k % 5 == 0:
            place = start + soft.response.compliance_ea[:3] @ soft.cable_tension + here.tip
            observer.measure_tip(now, place + 5e-4 * random.normal(size=3))
        if k == 149:
            assert abs(observer.estimate(GRAVITY, now).mass) < 0.05 * mass + 2 * observer.estimate(GRAVITY, now).mass_std
    found = observer.estimate(GRAVITY, now)
    low, high = found.mass_interval
    assert low <= mass <= high
    assert abs(found.mass - mass) < 0.2 * mass
    assert found.force == pytest.approx(found.mass * GRAVITY)


def with_tension(shape, tension):
    """Return the shape with its cables wound so that they have this tension."""
    response = shape.response
    return dataclasses.replace(
        shape,
        cable_tension=tension,
        cable_displacement=response.compliance_aa @ tension + response.displacement_free,
        tip_position=response.effector_free[:3] + response.compliance_ea[:3] @ tension,
    )


def test_a_robot_that_still_moves_when_zeroing_begins_is_not_taken_for_a_softer_one(shape):
    """The robot is its model. When the model lets go of what it has carried, the robot comes after it within half a second."""
    tip, shape = shape
    observer = LoadObserver(dataclasses.replace(ROBOT, cables=ROBOT.cables[:3]), LoadEstimationOptions(kind="payload"))
    random, mass = np.random.default_rng(3), 0.004
    for k in range(450):
        now, load = 0.02 * k, mass * GRAVITY * (k >= 255)
        behind = 0.3 * np.exp(-max(0.0, now - 2.0) / 0.2) * (k >= 100)  # of the tension by which the cables were pulled in
        held = with_tension(shape, np.array([1.5, 0.1, 0.1]) * (1.0 if k >= 100 else 0.7))
        observer.predict(now, held, tip, ZERO, held.cable_displacement)
        if k == 100:
            observer.zero(now)
        tension = held.cable_tension * (1.0 - behind) + HeldRobot(held, tip, held.cable_displacement, REST).under(load).tension
        observer.measure_tensions(now, tension * (1 + 0.01 * random.normal(size=3)) + 1e-3 * random.normal(size=3))
    found = observer.estimate(GRAVITY, now)
    low, high = found.mass_interval
    assert low <= mass <= high
    assert abs(found.mass - mass) < 0.2 * mass


def test_what_a_robot_measures_while_a_payload_lets_it_move_does_not_last(shape):
    """The robot is its model. Once the payload pulls more for 0.9 s, as one that falls does."""
    tip, shape = shape
    mass, held, found = 0.012, HeldRobot(shape, tip, shape.cable_displacement, REST), []
    for falls in (0.3, 0.0):
        observer = LoadObserver(dataclasses.replace(ROBOT, cables=ROBOT.cables[:3]), LoadEstimationOptions(kind="payload"))
        random = np.random.default_rng(6)
        for k in range(160):
            now = 0.04 * k
            observer.predict(now, shape, tip, ZERO, shape.cable_displacement)
            if k == 2:
                observer.zero(now)
            pull = mass * (1.0 + falls * (k < 112)) * (k >= 90)
            tension = shape.cable_tension + held.under(pull * GRAVITY).tension
            observer.measure_tensions(now, tension * (1 + 0.01 * random.normal(size=3)) + 1e-3 * random.normal(size=3))
        found.append(observer.estimate(GRAVITY, now).mass)
    assert abs(found[0] - found[1]) < 0.005 * mass
    assert abs(found[0] - mass) < 0.05 * mass


def test_a_payload_that_friction_may_hide_is_in_the_interval(shape):
    """It comes 2 s after zeroing, and changes the tensions by less than a contradiction: it could be friction that turns."""
    tip, shape = shape
    observer = LoadObserver(dataclasses.replace(ROBOT, cables=ROBOT.cables[:3]), LoadEstimationOptions(kind="payload"))
    random, mass, held = np.random.default_rng(2), 0.004, HeldRobot(shape, tip, shape.cable_displacement, REST)
    for k in range(330):
        now = 0.04 * k
        observer.predict(now, shape, tip, ZERO, shape.cable_displacement)
        if k == 50:
            observer.zero(now)
        tension = shape.cable_tension + held.under(mass * GRAVITY * (k >= 175)).tension
        observer.measure_tensions(now, tension * (1 + 0.01 * random.normal(size=3)))
        if k == 170:
            assert observer.estimate(GRAVITY, now).mass_std < 0.2 * mass
        if k > 200:  # a second later
            low, high = observer.estimate(GRAVITY, now).mass_interval
            assert low <= mass <= high


def test_friction_that_turns_round_while_the_errors_are_learnt_is_not_taken_for_stiffness(shape):
    """The robot is its model; its load cells are at the capstans, so that friction adds to or takes from what they read."""
    tip, shape = shape
    observer = LoadObserver(dataclasses.replace(ROBOT, cables=ROBOT.cables[:3]), LoadEstimationOptions(kind="force"))
    random, force = np.random.default_rng(1), np.array([-0.1, 0.05, 0.0])
    pulled, paid_out = (with_tension(shape, share * np.array([1.5, 0.1, 0.1])) for share in (1.0, 0.98))
    for k in range(400):
        now, load = 0.02 * k, force * (k >= 240)
        held, friction = (pulled, 1.04) if k % 75 < 38 else (paid_out, 0.96)
        observer.predict(now, held, tip, ZERO, held.cable_displacement)
        if k == 120:
            observer.zero(now)
        tension = held.cable_tension + HeldRobot(held, tip, held.cable_displacement, REST).under(load).tension
        observer.measure_tensions(now, friction * tension * (1 + 0.01 * random.normal(size=3)) + 1e-3 * random.normal(size=3))
    found = observer.estimate(GRAVITY, now)
    error = (found.force - force)[:2]
    assert error @ np.linalg.solve(found.covariance[:2, :2], error) < 9.2  # 1 in 100 is beyond
    assert np.sqrt(found.covariance[1, 1]) < 0.5 * abs(force[1])  # and something is known


def test_what_a_slow_tracker_has_seen_of_a_force_is_kept_between_its_samples(shape):
    """One taut cable tells one part of the force; the tracker tells the others, that along the robot to 0.25 N."""
    tip, shape = shape
    observer = LoadObserver(dataclasses.replace(ROBOT, cables=ROBOT.cables[:3]), LoadEstimationOptions(kind="force"))
    random, force = np.random.default_rng(5), np.array([-0.5, 0.0, 0.0])
    loaded = HeldRobot(shape, tip, shape.cable_displacement, REST).under(force)
    assert loaded.taut.sum() == 1
    for k in range(219):
        now, there = 0.04 * k, k >= 140
        observer.predict(now, shape, tip, ZERO, shape.cable_displacement)
        if k == 60:
            observer.zero(now)
        tension = shape.cable_tension + there * loaded.tension
        observer.measure_tensions(now, tension * (1 + 0.01 * random.normal(size=3)) + 1e-3 * random.normal(size=3))
        if k % 20 == 0:
            observer.measure_tip(now, shape.tip_position + there * loaded.tip + 5e-4 * random.normal(size=3))
    found = observer.estimate(GRAVITY, now)
    assert np.linalg.norm((found.force - force)[:2]) < 0.1 * np.linalg.norm(force)
    assert np.sqrt(found.covariance[2, 2]) < 1.0


def test_the_force_at_a_tip_far_away_is_averaged_until_it_changes():
    """The model follows a noisy tracker of 5 Hz; the robot yields along z by 5 mm/N and across by 400 mm/N."""
    needed, random = NeededForce(LoadEstimationOptions(kind="force")), np.random.default_rng(7)
    compliance, errors, lately_errors = np.diag([0.4, 0.4, 0.005]), [], []
    lately = collections.deque(maxlen=40)
    for k in range(600):
        now, true = 0.05 * k, np.array([0.15, 0.01 if k >= 500 else 0.0, 0.0])
        if k % 4 == 0:
            needed.tip_measured(now)
            force = true + np.linalg.solve(compliance, 5e-4 * random.normal(size=3))
        lately.append(force)
        needed.add(now, force, np.mean(lately, axis=0), compliance)
        errors.append(needed.mean - true)
        lately_errors.append(np.mean(lately, axis=0) - true)
    along, short = (float(np.mean(np.abs(np.array(one)[200:500, 2]))) for one in (errors, lately_errors))
    assert along < 0.6 * short
    # A change across, where the tip tells much, is followed as fast as before.
    assert abs(np.array(errors)[545:, 1]).max() < 0.002


def test_what_friction_hides_does_not_depend_on_the_rate_of_the_samples():
    once, often = (LoadFilter(LoadEstimationOptions(kind="force"), ROBOT.limits, 6, 3, 0.02) for _ in range(2))
    tension, still = np.full(6, 0.8), np.zeros(6)
    once.diffuse(1.0, 0.5, tension, still)
    for _ in range(100):
        often.diffuse(0.01, 0.5, tension, still)
    assert often.covariance == pytest.approx(once.covariance)
    for _ in range(20):
        once.diffuse(1.0, 0.5, tension, still)
    hidden = np.sqrt(np.diag(once.covariance)[-6:])
    assert hidden == pytest.approx(LoadEstimationOptions().cable_friction * tension, rel=1e-3)


def test_a_payload_far_below_what_the_cables_hold_does_not_follow_each_turn_of_friction(shape):
    """The cables hold 60 times as much; friction turns round every second and has a mean of none."""
    tip, shape = shape
    observer = LoadObserver(dataclasses.replace(ROBOT, cables=ROBOT.cables[:3]), LoadEstimationOptions(kind="payload"))
    random, mass, found = np.random.default_rng(4), 0.002, []
    loaded = HeldRobot(shape, tip, shape.cable_displacement, REST).under(mass * GRAVITY)
    for k in range(450):
        now, there = 0.02 * k, k >= 170
        observer.predict(now, shape, tip, ZERO, shape.cable_displacement)
        if k == 5:
            observer.zero(now)
        tension = shape.cable_tension + there * loaded.tension
        friction = 1.03 if (k // 50) % 2 else 0.97
        observer.measure_tensions(now, friction * tension * (1 + 0.01 * random.normal(size=3)) + 1e-3 * random.normal(size=3))
        if k >= 350:
            found.append(observer.estimate(GRAVITY, now).mass)
    low, high = observer.estimate(GRAVITY, now).mass_interval
    assert low <= mass <= high
    assert np.ptp(found) < 0.2 * mass


def test_a_payload_fades_alike_whatever_the_rate_of_the_samples_up_to_one_that_may_be_anything():
    options = LoadEstimationOptions(kind="payload", payload_time=10.0)
    once, often, long = (LoadFilter(options, ROBOT.limits, 6, 1, 0.02) for _ in range(3))
    tension, still = np.full(6, 0.8), np.zeros(6)
    for one in (once, often, long):
        one.set_load(np.array([0.002]), np.array([[1e-8]]))
    once.diffuse(1.0, 0.05, tension, still)
    for _ in range(100):
        often.diffuse(0.01, 0.05, tension, still)
    long.diffuse(1000.0, 0.05, tension, still)
    assert often.load_covariance == pytest.approx(once.load_covariance)
    assert once.load_covariance == pytest.approx(1e-8 * np.exp(0.2), rel=1e-3)
    assert long.load_covariance == pytest.approx(0.05**2) and long.load == pytest.approx(0.002)


def test_a_tip_that_arrives_late_does_not_let_the_time_pass_twice(shape, monkeypatch):
    tip, shape = shape
    observer = LoadObserver(dataclasses.replace(ROBOT, cables=ROBOT.cables[:3]), LoadEstimationOptions(kind="payload"))
    passed, diffuse = [], LoadFilter.diffuse
    monkeypatch.setattr(LoadFilter, "diffuse", lambda one, *given: (passed.append(given[0]), diffuse(one, *given)))
    for k in range(100):
        observer.predict(0.01 * k, shape, tip, ZERO, shape.cable_displacement)
        observer.measure_tensions(0.01 * k, shape.cable_tension + 1e-3 * np.sin([k, 2 * k, 3 * k]))
        if k > 20:
            observer.measure_tip(0.01 * (k - 10), shape.tip_position)
    assert 0.8 < sum(passed) < 1.0


def test_what_a_sensor_has_said_before_it_was_found_to_be_wrong_is_forgotten(shape):
    tip, shape = shape
    robot = dataclasses.replace(ROBOT, cables=ROBOT.cables[:3])
    observer = LoadObserver(robot, LoadEstimationOptions(kind="payload", compensate=False))
    random, carried = np.random.default_rng(3), 0.004 * GRAVITY
    tension = shape.cable_tension + HeldRobot(shape, tip, shape.cable_displacement, REST).under(carried).tension

    def measure(k, signs):
        observer.predict(0.01 * k, shape, tip, ZERO, shape.cable_displacement)
        observer.measure_tensions(0.01 * k, signs * tension * (1 + 0.01 * random.normal(size=3)))
        return observer.estimate(GRAVITY, 0.01 * k)

    for k in range(200):
        good = measure(k, np.ones(3))
    wrong = [measure(k, np.array([-1, 1, 1])) for k in range(200, 300)]
    assert good.sources and not good.sentence
    assert good.mass == pytest.approx(0.004, rel=0.1)
    assert "wrong sign" in wrong[-1].sentence and robot.cable_names[0] in wrong[-1].sentence
    assert wrong[-1].mass == pytest.approx(good.mass, rel=0.01)
    # Nothing of a sensor is used before enough was read to know it.
    observer.reset()
    first = [measure(k, np.array([-1, 1, 1])) for k in range(60)]
    assert "wrong sign" in first[-1].sentence and not any(one.sources for one in first)


def test_a_sensor_that_stops_is_named_while_the_other_one_goes_on(shape):
    tip, shape = shape
    observer = LoadObserver(dataclasses.replace(ROBOT, cables=ROBOT.cables[:3]), LoadEstimationOptions(kind="payload"))
    for k in range(500):
        now = 0.01 * k
        observer.predict(now, shape, tip, ZERO, shape.cable_displacement)
        observer.measure_tip(now, shape.tip_position)
        if k < 100:
            observer.measure_tensions(now, shape.cable_tension + 1e-3 * np.sin([k, 2 * k, 3 * k]))
    found = observer.estimate(GRAVITY, now)
    assert found.sources == ("tip",) and "measured/tension has not been used for 4.0 s" in found.sentence


def test_a_force_is_compensated_on_request_only(shape):
    tip, shape = shape
    robot = dataclasses.replace(ROBOT, cables=ROBOT.cables[:3])
    for compensates in (False, True):
        observer = LoadObserver(robot, LoadEstimationOptions(kind="force", compensate_force=compensates))
        for k in range(100):
            observer.predict(0.01 * k, shape, tip, ZERO, shape.cable_displacement)
            observer.measure_tip(0.01 * k, shape.tip_position + 1e-3 * np.eye(3)[1])
            wrench = observer.wrench(GRAVITY, 0.01 * k)
        assert (wrench is not None and wrench.force[1] > 0.0) == compensates


def test_without_sensors_the_load_is_said_to_be_unknown(shape):
    tip, shape = shape
    observer = LoadObserver(dataclasses.replace(ROBOT, cables=ROBOT.cables[:3]), LoadEstimationOptions(kind="force"))
    observer.predict(0.0, shape, tip, ZERO, shape.cable_displacement)
    found = observer.estimate(GRAVITY, 0.0)
    assert "not known" in found.sentence
    assert np.sqrt(found.covariance[0, 0]) > 0.1
