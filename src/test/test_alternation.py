"""Newton's method in contact with rough surfaces, where its steps alternate."""

import dataclasses

import numpy as np
import pytest

from gravcomp.bench.contact_lumens import tube_surface
from gravcomp.bench.contact_scenes import moved_robot, scene_of
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


@pytest.mark.parametrize(("fine", "noise_mm", "seed"), [(False, 0.3, 10), (True, 0.15, 13)], ids=["edges", "hollow corners"])
def test_a_robot_rests_in_a_rough_lumen(tmp_path, fine, noise_mm, seed):
    """Each triangle is a wall of its own: the robot lies on edges, whose force moves along it, and in hollow corners."""
    robot = moved_robot() if fine else dataclasses.replace(load_robot_file("article").robot, elements=Elements(4, 5))
    model = RobotModel(robot)
    line = 1e3 * model.length * np.column_stack([np.zeros((21, 2)), np.linspace(-0.3, 1.6, 21)])
    lumen = tube_surface(line, 8.5, noise_mm, seed)
    assert lumen.is_watertight and lumen.volume > 0
    lumen.export(tmp_path / "lumen.stl")
    scene = scene_of(meshes=[{"file": str(tmp_path / "lumen.stl"), "side": "inside", "file_unit_mm": 1}])
    simulator = Simulator(model, reduced=False, scene=scene)
    for angle in np.random.default_rng(seed).uniform(0, 2 * np.pi) + 0.07 * np.arange(6):
        shape = simulator.step(9.81 * np.array([np.cos(angle), np.sin(angle), 0.1]))
        assert shape.is_equilibrium, shape.message
        assert sampled_depth(simulator.solver.contact, simulator.displacements) < 0.02e-3
