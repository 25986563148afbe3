"""Newton's method in contact with rough surfaces, where its steps alternate."""

import dataclasses

import numpy as np
import pytest
import trimesh

from gravcomp.bench.contact_scenes import scene_of
from gravcomp.bench.sampled_depth import sampled_depth
from gravcomp.description import Elements, load_robot_file
from gravcomp.full_model.alternation import Alternation
from gravcomp.simulation import RobotModel, Simulator


def test_steps_that_alternate_end_at_their_limit():
    limit, rate = np.array([3.0, -1.0]), -1.1  # each step is longer than the one before
    place, alternation = np.zeros(2), Alternation()
    for _ in range(2):
        step = (rate - 1.0) * (place - limit)
        place = place + alternation.part(step) * step
    np.testing.assert_allclose(place, limit, atol=1e-12)


@pytest.mark.parametrize("second", [[2.0, 0.0], [0.0, 5.0], [-0.4, 1.0]])
def test_steps_that_go_on_or_aside_are_taken_whole(second):
    alternation = Alternation()
    assert alternation.part(np.array([1.0, 0.0])) == 1.0
    assert alternation.part(np.array(second)) == 1.0


def test_an_equilibrium_begins_without_the_steps_of_the_one_before():
    alternation = Alternation()
    alternation.part(np.array([1.0]))
    alternation.begin()
    assert alternation.part(np.array([-1.0])) == 1.0


def test_a_robot_rests_in_a_rough_lumen(tmp_path):
    """Each triangle is a wall of its own: the robot lies on edges and corners, whose force moves along it."""
    model = RobotModel(dataclasses.replace(load_robot_file("article").robot, elements=Elements(around=4, along=5)))
    lumen = rough_lumen(radius_mm=8.5, length_mm=1e3 * model.length, noise_mm=0.3, seed=10)
    lumen.export(tmp_path / "lumen.stl")
    scene = scene_of(meshes=[{"file": str(tmp_path / "lumen.stl"), "side": "inside", "file_unit_mm": 1}])
    simulator = Simulator(model, reduced=False, scene=scene)
    for angle in np.random.default_rng(10).uniform(0, 2 * np.pi) + 0.07 * np.arange(6):
        shape = simulator.step(9.81 * np.array([np.cos(angle), np.sin(angle), 0.1]))
        assert shape.is_equilibrium, shape.message
        assert sampled_depth(simulator.solver.contact, simulator.displacements) < 0.02e-3


def rough_lumen(radius_mm: float, length_mm: float, noise_mm: float, seed: int, around=24, along=20) -> trimesh.Trimesh:
    """A closed tube about the robot whose corners are displaced at random."""
    z, angle = np.linspace(-0.3 * length_mm, 1.6 * length_mm, along + 1), 2 * np.pi * np.arange(around) / around
    tube = np.array([[radius_mm * np.cos(a), radius_mm * np.sin(a), h] for h in z for a in angle])
    tube += noise_mm * np.random.default_rng(seed).standard_normal(tube.shape)
    faces = []
    for row in range(along):
        for k in range(around):
            here, ahead = row * around + k, row * around + (k + 1) % around
            faces += [[here, ahead, here + around], [ahead, ahead + around, here + around]]
    count = len(tube)
    for k in range(around):
        ahead = (k + 1) % around
        faces += [[count, ahead, k], [count + 1, along * around + k, along * around + ahead]]
    found = trimesh.Trimesh(np.vstack([tube, [0, 0, z[0]], [0, 0, z[-1]]]), faces, process=False)
    assert found.is_watertight and found.volume > 0
    return found
