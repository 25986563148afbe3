"""The quadratic programme of one step: weights, optimality, and bounds that cannot be satisfied."""

from types import SimpleNamespace

import numpy as np
import pytest
from arc_robot import LENGTH, STATIONS, ArcRobot

from gravcomp.description.robot import Limits
from gravcomp.inverse import InverseOptions, direction_weight, straight_target
from gravcomp.inverse.limits import StepBounds
from gravcomp.inverse.programme import _turned_in_place, build_programme
from gravcomp.inverse.scaling import Programme, scaled, unscaled
from gravcomp.inverse.solver import ProgrammeSolver

GRAVITY = 9.81


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


def test_incompatible_bounds_are_violated_as_little_as_possible():
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
    # The programme's cost equals the weighted squares of the errors, evaluated term by term.
    robot, gravity = ArcRobot(), np.array([-GRAVITY, 0.0, 0.0])
    response = robot.step(gravity, None, iterations=20)
    target = straight_target(LENGTH, tip_direction_weight=1e-3, backbone_station=[0.3], backbone_weight=[0.7])
    options = InverseOptions(energy_weight=1e-6, proximal_weight=0.0, axial_weight=0.25)
    zeros, apart = np.zeros(6), turned_in_place(response)
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
        return tip[:2] @ tip[:2] + along_target * tip[2] ** 2 + 1e-3 * np.sum((apart @ (e[3:6] - [0, 0, 1])) ** 2) + middle

    tension = np.array([0.1, 0.2, 0.0, 0.3, 0.0, 0.1])
    x = tension / programme.scale
    quadratic = 2e-6 * (0.5 * x @ programme.hessian @ x + programme.gradient @ x)  # its cost is in mm^2, halved
    assert quadratic == pytest.approx(cost(tension) - cost(np.zeros(6)), rel=1e-3)


def turned_in_place(response, cables=slice(None)):
    """D (3, 3) of the programme's text for some of the cables, at a shape without tension and the target along z."""
    root = np.sqrt(np.diag(response.compliance_aa)[cables])
    points, moved = response.effector_free[6:].reshape(-1, 3), response.compliance_ea[6:, cables].reshape(len(STATIONS), 3, -1)
    along = np.diff(points, axis=0) / np.linalg.norm(np.diff(points, axis=0), axis=1)[:, None]
    longer = np.einsum("ki,kic->c", along, np.diff(moved, axis=0))
    kept = np.vstack([response.compliance_ea[:2, cables], longer]) / root
    turn = response.compliance_ea[3:6, cables] / root
    weight = kept @ kept.T
    weight[2, 2] += 1e-5 * np.trace(weight)
    part = turn @ turn.T - turn @ kept.T @ np.linalg.inv(weight) @ kept @ turn.T
    return part @ np.linalg.inv(part + 1e-3 * np.linalg.norm(turn, 2) ** 2 * np.eye(3))


def found_in_place(response, cables=slice(None)):
    """What the programme computes, as `turned_in_place`."""
    change, compliance = response.compliance_ea[:, cables], response.compliance_aa[cables][:, cables]
    return _turned_in_place(
        np.ascontiguousarray(change), response.effector_free, np.ascontiguousarray(compliance), np.array([0.0, 0.0, 1.0])
    )


def test_the_direction_counts_where_cables_turn_the_tip_in_place():
    robot = ArcRobot()
    response = robot.step(np.zeros(3), None)
    assert np.linalg.eigvalsh(turned_in_place(response))[1:] == pytest.approx([1.0, 1.0], abs=0.1)
    assert np.abs(turned_in_place(response, [3, 4, 5])).max() < 1e-3
    for cables in ([0, 1, 2, 3, 4, 5], [3, 4, 5]):
        assert found_in_place(response, cables) == pytest.approx(turned_in_place(response, cables), abs=1e-6)


def test_the_direction_counts_in_a_bent_robot_but_not_by_pulling_it_together():
    """Sagging, two segments still turn the tip in place. One segment turns it in place only as all of its cables shorten it."""
    response = ArcRobot().step(np.array([-GRAVITY, 0.0, 0.0]), None, iterations=20)
    assert np.linalg.eigvalsh(found_in_place(response))[1:] == pytest.approx([1.0, 1.0], abs=0.1)
    assert np.abs(found_in_place(response, [3, 4, 5])).max() < 0.05


def test_a_weight_of_the_direction_does_not_pull_cables_that_only_bend_off_the_place():
    """Cables of one segment: a weight of the direction costs hardly any sag in one step; with all of it 9 % would remain."""
    response = ArcRobot().step(np.array([-GRAVITY, 0.0, 0.0]), None, iterations=20)
    near = []
    for weight in (0.0, direction_weight(LENGTH)):
        of_one = SimpleNamespace(
            compliance_aa=response.compliance_aa[3:, 3:],
            compliance_ea=response.compliance_ea[:, 3:],
            displacement_free=response.displacement_free[3:],
            effector_free=response.effector_free,
        )
        programme = build_programme(
            of_one,
            straight_target(LENGTH, tip_direction_weight=weight),
            Limits(tension_max=50.0, tension_rate=1e5, displacement_rate=10.0),
            tension=np.zeros(3),
            displacement=np.zeros(3),
            backbone_station=STATIONS,
            interval=0.1,
            damping=1.0,
            options=InverseOptions(proximal_weight=0.0),
        )
        solution = ProgrammeSolver().solve(programme)
        tension = unscaled(
            solution.unknowns, solution.multipliers, programme.scale, programme.tension_lower, programme.tension_upper
        )[0]
        near.append(np.linalg.norm((of_one.compliance_ea @ tension + of_one.effector_free)[:2]))
    sag = np.linalg.norm(response.effector_free[:2])
    assert near[0] < 0.005 * sag
    assert near[1] < 0.02 * sag


def test_only_a_cable_that_may_be_slack_is_paid_out_beyond_its_path():
    """Both bounds are active; a cable with a pretension that is paid out loses it, and the next step pays it out farther."""
    scale, upper = np.full(2, 0.1), np.full(2, 5.0)
    tension, unwanted = unscaled(np.zeros(2), np.full(2, -0.3), scale, np.array([0.05, 0.0]), upper)
    np.testing.assert_allclose(tension, [0.05, 0.0])
    np.testing.assert_allclose(unwanted, [0.0, 0.03])
