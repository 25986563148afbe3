"""Tendons and slack: exact derivatives, capstan friction, complementarity."""

import dataclasses

import numpy as np
import pytest

from gravcomp.cables.friction import Sliding
from gravcomp.cables.routing import route_cables
from gravcomp.cables.slack import taut_tensions
from gravcomp.description import Cable, Elements, load_robot_file
from gravcomp.full_model.cable_input import CableInput
from gravcomp.full_model.statics import StaticSolver
from gravcomp.mesh import MeshError, body_mesh
from gravcomp.mesh.sections import is_one_region
from gravcomp.simulation import RobotModel


@pytest.fixture(scope="module")
def model():
    robot = load_robot_file("article").robot
    return RobotModel(dataclasses.replace(robot, elements=Elements(along=4)))


def bent(model) -> np.ndarray:
    z = model.mesh.nodes[:, 2] / model.length
    u = np.column_stack([0.02 * z**2, 0.005 * z**2, -0.003 * z])
    u[model.n_free :] = 0.0
    return u


def direction(model) -> np.ndarray:
    field = np.zeros_like(model.mesh.nodes)
    field[: model.n_free] = np.random.default_rng(3).normal(size=(model.n_free, 3))
    return field


def test_rest_lengths_are_the_paths(model):
    assert model.tendons.rest_length == pytest.approx([0.05] * 3 + [0.1] * 3, rel=1e-9)
    assert model.tendons.state(model.mesh.nodes).displacement == pytest.approx(np.zeros(6), abs=1e-15)


def test_jacobian_and_stiffness_are_exact(model):
    x, step, h = model.mesh.nodes + bent(model), direction(model), 1e-7
    tension = np.arange(6) * 0.1
    state = model.tendons.state(x)
    more, less = model.tendons.state(x + h * step), model.tendons.state(x - h * step)
    change = (more.displacement - less.displacement) / (2 * h)
    assert state.jacobian @ model.free(step) == pytest.approx(change, rel=1e-6)
    matrix = model.new_matrix()
    model.tendons.add_stiffness(state, tension, matrix)
    # The cables' force enters the equilibrium with a minus sign, so its stiffness is minus its derivative.
    force_change = (more.jacobian - less.jacobian).T @ tension / (2 * h)
    assert matrix.multiply(model.free(step)) == pytest.approx(-force_change, abs=1e-6 * np.abs(force_change).max())


def test_friction_follows_the_capstan_equation():
    robot = load_robot_file("article").robot
    cables = tuple(dataclasses.replace(c, friction=0.3) for c in robot.cables)
    model = RobotModel(dataclasses.replace(robot, elements=Elements(along=4), cables=cables))
    x = model.mesh.nodes + bent(model)
    state = model.tendons.state(x, np.ones(6))
    pieces = np.flatnonzero(model.tendons._cable == 3)
    turned = np.arccos(np.clip((state.tangent[pieces[1:]] * state.tangent[pieces[:-1]]).sum(1), -1, 1)).sum()
    assert turned > 0.1
    assert state.share[pieces[-1]] == pytest.approx(np.exp(-0.3 * turned))
    assert model.tendons.state(x, -np.ones(6)).share[pieces[-1]] == pytest.approx(np.exp(0.3 * turned))


def test_a_cable_outside_the_body_is_refused():
    robot = load_robot_file("mesh_body").robot
    outside = Cable("far", angle=0.0, radius=4.2e-3, end=0.08)
    with pytest.raises(MeshError, match="cable 'far' leaves the body"):
        RobotModel(dataclasses.replace(robot, cables=(outside,)))


def test_a_cable_in_a_body_from_a_file_moves_with_its_sections_where_they_are_one_region():
    robot = load_robot_file("mesh_body").robot
    mesh = body_mesh(robot)
    stretch = np.array([[1.1, 0.1, 0.0], [-0.2, 0.9, 0.3], [0.0, 0.1, 1.2]])
    middle = mesh.nodes[mesh.elements].mean(axis=1)
    forked = dataclasses.replace(mesh, elements=mesh.elements[(np.abs(middle[:, 0]) > 1e-3) | (middle[:, 2] < 0.05)])
    assert is_one_region(forked, 0.03) and not is_one_region(forked, 0.065)
    for body, spread in ((mesh, 20), (forked, 1)):
        points = route_cables(robot, body)[1].points
        place = np.einsum("pc,pci->pi", points.weights, body.nodes[points.nodes])
        assert place[0] == pytest.approx([-1.1e-3, 1.9053e-3, 0.0], abs=1e-7)
        assert np.einsum("pc,pci->pi", points.weights, (body.nodes @ stretch)[points.nodes]) == pytest.approx(place @ stretch)
        nodes = (points.weights != 0.0).sum(axis=1)
        assert nodes[:10].min() > 20 and (nodes[-3:].max() > 20) == (spread > 1)


def test_explicit_via_points_are_followed():
    robot = load_robot_file("article").robot
    points = tuple((3e-3 * np.cos(a), 3e-3 * np.sin(a), z) for a, z in zip(np.linspace(0, 1, 6), np.linspace(0, 0.1, 6)))
    model = RobotModel(dataclasses.replace(robot, elements=Elements(along=4), cables=(Cable("helix", via_points=points),)))
    length = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
    assert model.tendons.rest_length == pytest.approx([length], rel=1e-9)


@pytest.mark.parametrize("seed", range(20))
def test_complementarity_from_any_guess(seed):
    rng = np.random.default_rng(seed)
    m = 6
    root = rng.normal(size=(m, m))
    compliance, free, wound = root @ root.T + 0.1 * np.eye(m), rng.normal(size=m), rng.normal(size=m)
    tension = taut_tensions(compliance, free, wound, rng.random(m) > 0.5)
    slack = compliance @ tension + free - wound
    assert tension.min() >= 0.0 and slack.min() > -1e-9
    assert np.abs(tension * slack).max() < 1e-9


def test_released_cables_carry_nothing():
    tension = taut_tensions(np.eye(3), np.zeros(3), np.array([0.1, np.nan, -0.1]))
    assert tension == pytest.approx([0.1, 0.0, 0.0])


def test_a_command_that_trembles_does_not_reverse_the_friction():
    """It turns round over a way of the cable, however small the steps are; a released cable is paid out at once."""
    sliding = Sliding.none(2, 0.1)
    way, none = sliding.way, np.zeros(2)
    assert 1e-5 < way < 1e-4
    sliding = sliding.after(np.array([1e-3, 1e-3]), None, none, none)
    np.testing.assert_array_equal(sliding.direction, [1.0, 1.0])
    for tremble in 1e-3 + 0.02 * way * np.array([-1.0, 1.0, -1.0, 1.0]):
        sliding = sliding.after(np.array([tremble, 1e-3]), None, none, none)
        assert sliding.direction[0] > 0.9
    for step in range(1, 41):
        sliding = sliding.after(np.array([tremble - 0.05 * step * way, np.nan]), None, np.ones(2), none)
        assert sliding.direction[0] == pytest.approx(min(1.0, max(-1.0, 1.0 - 0.05 * step)), abs=0.05)
        assert sliding.direction[1] == -1.0


@pytest.mark.parametrize("between", ["released", "tension"])
def test_after_a_release_or_given_tensions_a_cable_slides_from_where_it_is(between):
    """What was wound in before says nothing: a cable of 3 mm that comes from 1 mm is pulled in, also if it had 5 mm once."""
    sliding = Sliding.none(1, 0.1).after(np.array([5e-3]), None, np.zeros(1), np.zeros(1))
    given = None if between == "released" else np.array([0.5])
    for tension in (1.0, 0.5):
        sliding = sliding.after(None, given, np.array([tension]), np.array([1e-3]))
    assert sliding.direction == pytest.approx([-1.0])
    assert sliding.after(np.array([3e-3]), None, np.zeros(1), np.array([1e-3])).direction == pytest.approx([1.0])


def test_a_part_of_the_load_that_fails_leaves_no_trace_in_the_friction():
    """The next, smaller part pulls the cables in from the last equilibrium; it does not pay them out from the one that failed."""
    directions = []

    class Refusing(StaticSolver):
        tried = 0

        def track(self, gravity, cables, *args, **kwargs):
            self.tried += 1
            state = dataclasses.replace(self.state, converged=self.tried not in (1, 2, 4))
            self.sliding = cables.sliding(self.sliding, state.tension, state.tendons.displacement)
            if state.converged:
                self.state = state
                directions.append(self.sliding.direction)
            return state

    robot = dataclasses.replace(load_robot_file("article").robot, elements=Elements(around=4, along=4))
    solver = Refusing(RobotModel(robot))
    assert solver.solve(np.zeros(3), CableInput(wound=np.full(6, 5e-3))).converged
    assert solver.tried > 5 and np.array(directions) == pytest.approx(1.0)
