"""External forces and moments: against beam theory, dead against turning loads, and in the reduced model."""

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gravcomp.cables.routing import route_cables
from gravcomp.description import Elements, Material, Robot, Segment, load_robot_file
from gravcomp.full_model.turning_loads import slopes_of
from gravcomp.full_model.wrench import PointLoads, Wrench
from gravcomp.reduction.basis import energy_basis
from gravcomp.reduction.reduced_loads import ReducedLoads
from gravcomp.simulation import RobotModel, Simulator

LENGTH, RADIUS, MODULUS = 0.2, 0.002, 5e6
STIFFNESS = MODULUS * np.pi * RADIUS**4 / 4
ROD = Robot(
    "rod",
    segments=(Segment("rod", LENGTH, 2 * RADIUS, material=Material("svk", MODULUS, 0.0, density=0.0)),),
    elements=Elements(around=4, along=16, grading=1.0, equal_stiffness=True),
)


@pytest.fixture(scope="module")
def rod():
    return Simulator(ROD, reduced=False)


def test_a_moment_bends_a_rod_to_an_arc_also_beyond_a_right_angle(rod):
    angle = 2.0
    for follower in (False, True):  # across the plane of the arc a moment is the same in both frames
        shape = rod.solve(np.zeros(3), wrench=Wrench(moment=[0.0, STIFFNESS * angle / LENGTH, 0.0], follower=follower))
        radius = LENGTH / angle
        assert shape.tip_position == pytest.approx([radius * (1 - np.cos(angle)), 0, radius * np.sin(angle)], abs=5e-3 * LENGTH)


def test_a_follower_force_stays_across_the_tip(rod):
    """A fixed force that stands across the bent tip gives the same shape as the follower, and its moment at the clamp."""
    force = 2.0 * STIFFNESS / LENGTH**2
    turned = rod.solve(np.zeros(3), wrench=Wrench(force=[force, 0.0, 0.0], follower=True))
    fixed = Rotation.from_quat(turned.tip_orientation).apply([force, 0.0, 0.0])
    assert np.linalg.norm(fixed - [force, 0.0, 0.0]) > 0.5 * force
    same = rod.solve(np.zeros(3), wrench=Wrench(force=fixed))
    assert same.tip_position == pytest.approx(turned.tip_position, abs=1e-6)


def test_a_lever_adds_the_moment_of_its_force(rod):
    force, lever = np.array([0.0, 0.0, -0.5 * STIFFNESS / LENGTH**2]), np.array([0.01, 0.0, 0.02])
    shape = rod.solve(np.zeros(3), wrench=Wrench(force=force, lever=lever))
    moment = np.cross(Rotation.from_quat(shape.tip_orientation).apply(lever), force)
    same = rod.solve(np.zeros(3), wrench=Wrench(force=force, moment=moment))
    assert same.tip_position == pytest.approx(shape.tip_position, abs=1e-6)


def test_the_tangent_of_turning_loads_is_their_derivative(rod):
    wrench = Wrench([0.1, -0.2, 0.05], [0.003, 0.001, -0.002], 0.6, follower=True, lever=np.array([0.002, -0.001, 0.004]))
    loads = PointLoads.of(rod.model, wrench)
    random = np.random.default_rng(1)
    u = 0.01 * LENGTH * random.normal(size=rod.model.mesh.nodes.shape)
    change = 1e-6 * LENGTH * random.normal(size=u.shape)
    change[rod.model.n_free :] = 0.0
    difference = (loads.at(u + change) - loads.at(u - change)) / 2.0
    rows = loads.turning[0][1]
    moved = slopes_of(loads, u, 1.0)[0] @ (rows @ change).ravel()
    assert rod.model.free(rows.T @ moved.reshape(3, 3)) == pytest.approx(difference, abs=1e-6 * np.abs(difference).max())


def test_loads_that_turn_are_tracked_as_they_are_solved(rod):
    wrench = Wrench(force=[0.0, 0.5 * STIFFNESS / LENGTH**2, 0.0], moment=[0.0, 0.5 * STIFFNESS / LENGTH, 0.0], follower=True)
    rod.reset()
    for share in np.linspace(0.1, 1.0, 10):
        part = dataclasses.replace(wrench, force=share * wrench.force, moment=share * wrench.moment)
        shape = rod.step(np.zeros(3), wrench=part)
        assert shape.is_equilibrium
    assert shape.tip_position == pytest.approx(rod.solve(np.zeros(3), wrench=wrench).tip_position, abs=1e-5 * LENGTH)


def test_reduced_forces_are_the_projected_ones():
    model = RobotModel(dataclasses.replace(load_robot_file("article").robot, elements=Elements(around=4, along=4)))
    assert len(route_cables(model.robot, model.mesh)) == 6
    matrix = model.new_matrix()
    model.elements.assemble(np.zeros_like(model.mesh.nodes), matrix)
    random = np.random.default_rng(2)
    basis = energy_basis(random.normal(size=(5, 3 * model.n_free)), matrix.multiply, 5)
    q = 1e-4 * random.normal(size=5)
    u = np.zeros_like(model.mesh.nodes)
    model.free(u)[:] = basis @ q
    loads = PointLoads.of(model, (Wrench([0.1, 0.0, 0.2], station=0.37), Wrench(moment=[1e-3, 0.0, 2e-3], follower=True)))
    assert ReducedLoads(model, basis).at(loads, q) == pytest.approx(basis.T @ loads.at(u), rel=1e-9)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [({"force": [np.nan, 0, 0]}, "finite"), ({"moment": [0, 0]}, "three"), ({"station": 1.2}, "allowed: 0 at the base")],
)
def test_wrenches_that_are_none_are_refused(changes, reason):
    with pytest.raises(ValueError, match=reason):
        Wrench(**changes)
