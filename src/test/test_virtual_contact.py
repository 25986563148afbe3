"""The rod of the virtual robot at walls: closed forms, friction, rest, energy, depth."""

import dataclasses

import numpy as np
import pytest
from virtual_article import given, reference_robot, true_robot, with_body

from gravcomp.scene import BoxWall, PlaneWall, SceneSection, SphereWall, TubeWall
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
DEPTH = 0.02e-3  # m, that a rigid wall may be entered by


def rod_at(start=np.zeros(3), base=None, gravity=np.zeros(3), body=None, **walls) -> MovingRod:
    """A rod at walls (lists of a `SceneSection`), at first in the equilibrium without them under the acceleration `start`."""
    parameters = with_body(tendons=dataclasses.replace(given().tendons, friction=0.0), **(body or {}))
    true = true_robot(reference_robot(), parameters)
    model = build_rod(true)
    around = RodSurroundings.of(model, true, Scene(SceneSection(**walls)))
    rod = MovingRod(model, build_material(model, true), build_friction(true), around)
    base = np.eye(3) if base is None else base
    rod.rest(equilibrium(model, base.T @ start), base, np.zeros(3))
    return rod


def run(rod, seconds, gravity=np.zeros(3), pose=lambda time: (np.eye(3), np.zeros(3))):
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
