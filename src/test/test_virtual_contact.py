"""The rod of the virtual robot at walls: closed forms, friction, rest, energy, depth."""

import dataclasses

import numpy as np
import pytest
from virtual_article import given, reference_robot, true_robot, with_body

from gravcomp.bench.contact_rods import rods
from gravcomp.scene import BoxWall, PlaneWall, SceneSection, TubeWall
from gravcomp.scene.scene import Scene
from gravcomp.virtual.body import build_friction, build_material, build_rod
from gravcomp.virtual.dynamics import MovingRod
from gravcomp.virtual.equilibrium import equilibrium
from gravcomp.virtual.motion import base_orientation, turned
from gravcomp.virtual.surroundings import RodSurroundings

DT = 2e-3
RELEASED = np.full(6, -8e-3)
ELASTIC = {"creep_ratio": (), "creep_time": (), "slip_ratio": 0.0, "poissons_ratio": 0.0}
RADIUS = 4.5e-3
WEIGHTLESS = np.zeros(3)
DEPTH = 0.02e-3  # m, that a rigid wall may be entered by


def rod_at(body=None, **walls) -> MovingRod:
    """A rod at walls (lists of a `SceneSection`), at first unloaded; its base is that of the fixed frame."""
    parameters = with_body(tendons=dataclasses.replace(given().tendons, friction=0.0), **(body or {}))
    true = true_robot(reference_robot(), parameters)
    model = build_rod(true)
    around = RodSurroundings.of(model, true, Scene(SceneSection(**walls)))
    rod = MovingRod(model, build_material(model, true), build_friction(true), around)
    rod.rest(equilibrium(model, np.zeros(3)), np.eye(3), np.zeros(3))
    return rod


def still(time):
    return np.eye(3), np.zeros(3)


def run(rod, seconds, gravity=WEIGHTLESS, pose=still):
    """Step along `pose`; every step converges and none enters a wall. Yield the time of each."""
    for k in range(1, round(seconds / DT) + 1):
        assert rod.step(DT, *pose(k * DT), gravity, RELEASED), k
        assert rod.touches.depth.max(initial=0.0) < DEPTH
        yield k * DT


def last(steps):
    for _ in steps:
        pass


def test_a_cantilever_that_leans_on_a_plane_presses_as_beam_theory_says():
    # Of the sag under w the plane takes 30 % away: F (L^3 / 3 E I + L / k G A) = share (w L^4 / 8 E I + w L^2 / 2 k G A).
    share, weight = 0.3, np.array([-0.2, 0.0, 0.0])
    rod = rod_at(body=ELASTIC | {"damping_time": 0.03}, planes=(PlaneWall(point=(-1.0, 0.0, 0.0)),))
    model = rod.model
    bending, shear, line = model.stiffness[5, 4, 4], model.stiffness[5, 0, 0], 0.2 * model.mass.sum() / 0.1
    sag = line * 0.1**4 / (8 * bending) + line * 0.1**2 / (2 * shear)
    plane = PlaneWall(point=(-RADIUS - (1.0 - share) * sag, 0.0, 0.0), normal=(1.0, 0.0, 0.0))
    rod = rod_at(body=ELASTIC | {"damping_time": 0.03}, planes=(plane,))
    last(run(rod, 1.5, weight))
    force = share * sag / (0.1**3 / (3 * bending) + 0.1 / shear)
    np.testing.assert_allclose(rod.touches.force.sum(axis=0), [force, 0.0, 0.0], rtol=5e-3, atol=1e-6)
    assert rod.position[-1, 0] == pytest.approx(-(1.0 - share) * sag, rel=5e-3)


def test_a_rod_at_rest_on_a_wall_does_not_move():
    floor = PlaneWall(point=(-0.015, 0.0, 0.0), normal=(1.0, 0.0, 0.0), friction=0.3)
    rod = rod_at(body=ELASTIC | {"damping_time": 0.03}, planes=(floor,))
    last(run(rod, 1.6, np.array([-9.81, 0.0, 0.0])))
    before, force = rod.position.copy(), rod.touches.force.sum(axis=0)
    last(run(rod, 0.2, np.array([-9.81, 0.0, 0.0])))
    np.testing.assert_allclose(rod.position, before, atol=1e-6)
    np.testing.assert_allclose(rod.touches.force.sum(axis=0), force, rtol=1e-3, atol=1e-6)


def test_friction_slips_at_coulombs_limit_against_the_motion():
    floor = PlaneWall(point=(-0.012, 0.0, 0.0), normal=(1.0, 0.0, 0.0), friction=0.4, frame="world")
    rod = rod_at(body=ELASTIC | {"damping_time": 0.03}, planes=(floor,))
    last(run(rod, 0.6, np.array([-9.81, 0.0, 0.0])))
    last(run(rod, 0.6, np.array([-9.81, 0.0, 0.0]), lambda time: (np.eye(3), np.array([0.0, 0.0, 0.02 * time]))))
    force = rod.touches.force.sum(axis=0)
    assert force[2] == pytest.approx(-0.4 * force[0], rel=1e-3)
    assert abs(force[1]) < 1e-3 * force[0]


def energy(rod) -> float:
    model = rod.model
    stretched = rod.strain - model.rest_strain
    elastic = 0.5 * float(np.einsum("e,ei,eij,ej", model.length, stretched, model.stiffness, stretched))
    turning = float(np.einsum("ki,kij,kj", rod.velocity[:, 3:], model.inertia, rod.velocity[:, 3:]))
    return elastic + 0.5 * (float((model.mass * (rod.velocity[:, :3] ** 2).sum(axis=1)).sum()) + turning)


def test_no_energy_is_gained_where_an_undamped_rod_is_thrown_at_walls():
    planes = tuple(PlaneWall(point=(side * 8e-3, 0.0, 0.0), normal=(-side, 0.0, 0.0)) for side in (-1.0, 1.0))
    rod = rod_at(body=ELASTIC | {"damping_time": 0.0}, planes=planes)
    rod.velocity[1:, 0] = -0.3 * rod.model.station[1:] ** 2
    course, forces = [energy(rod)], []
    for _ in run(rod, 0.8):
        course.append(energy(rod))
        forces.append(rod.touches.force.sum(axis=0)[0])
    assert min(forces) < 0.0 < max(forces), "it meets both walls"
    # What the free steps of the generalized-alpha method pass from one mode to the other is less than a thousandth.
    assert (np.diff(course) / course[0]).max() < 1e-3
    assert course[-1] < course[0]


@pytest.mark.parametrize("seed", range(4))
def test_no_wall_is_entered_in_motion(seed):
    random = np.random.default_rng(seed)
    arc = [(0.08 * (1 - np.cos(t)), 0.0, 0.04 + 0.08 * np.sin(t)) for t in np.linspace(0.2, 1.5, 7)]
    tube = TubeWall(
        points=((0.0, 0.0, -0.06), (0.0, 0.0, 0.0), (0.0, 0.0, 0.04), *arc), radius=(0.009,), friction=0.2, frame="world"
    )
    box = BoxWall(centre=(-0.018, 0.0, 0.07), size=(0.01, 0.05, 0.01), friction=0.3, frame="world")
    walls = {"tubes": (tube,)} if seed % 2 else {"boxes": (box,)}
    rod = rod_at(**walls)
    spin, push = 0.3 * random.standard_normal(3), 0.03 if seed % 2 else 0.0
    spin[:2] *= 0.1 if seed % 2 else 1.0

    def pose(time):
        return turned(spin * np.sin(6.0 * time)), np.array([0.0, 0.0, push * time - 0.06 * (seed % 2)])

    if seed % 2:
        rod.carry(np.eye(3), np.array([0.0, 0.0, -0.06]))
    gravity = -9.81 * base_orientation(0.3, random.uniform(-3, 3))[2]
    last(run(rod, 1.0, gravity, pose))


def test_the_rod_rests_where_the_finite_element_model_does():
    """Two codes, each with its own contact, in a scene of `bench contact`."""
    figures = rods(lambda _: None, every=30)
    assert list(figures["rod_by_scene"]) == ["0"]
    assert figures["rod_tip_pct"]["worst"] < 0.1
    assert figures["rod_force_pct"]["worst"] < 2.0
