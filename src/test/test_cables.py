"""Tendons and slack: exact derivatives, capstan friction, complementarity."""

import dataclasses

import numpy as np
import pytest

from gravcomp.cables.routing import route_cables
from gravcomp.cables.slack import taut_tensions
from gravcomp.description import Cable, Elements, load_robot_file
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
    with pytest.raises(MeshError, match="cable 'far' leaves the body at"):
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
