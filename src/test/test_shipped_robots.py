"""The shipped robots: each sags visibly on the model and on the virtual robot, and has its picture in the README."""

from pathlib import Path

import numpy as np
import pytest
from virtual_article import GRAVITY

from gravcomp.closed_loop.setup import Setup
from gravcomp.description import load_robot_file, shipped_robots
from gravcomp.full_model.robot_model import RobotModel
from gravcomp.mesh.quality import mesh_quality
from gravcomp.simulation import Simulator
from gravcomp.virtual.motion import StaticMotion, base_orientation
from gravcomp.virtual.robot import VirtualRobot

ROOT = Path(__file__).resolve().parents[2]
ROBOTS = list(shipped_robots())


@pytest.fixture(scope="module", params=ROBOTS)
def shipped(request):
    """A shipped robot: its setup, and its shape when it is horizontal and its cables are released."""
    setup = Setup.of(load_robot_file(request.param))
    model = RobotModel(setup.robot)
    return setup, model, Simulator(model, reduced=False).solve([-GRAVITY, 0.0, 0.0])


def test_the_mesh_is_well_shaped_and_the_released_robot_sags_visibly(shipped):
    setup, model, shape = shipped
    assert mesh_quality(model.mesh).jacobian_ratio > 0.2
    assert shape.is_equilibrium, shape.message
    # Enough to be seen, and not so much that cables of this length and radius cannot raise it.
    assert 0.08 < -shape.tip_position[0] / setup.robot.length < 0.6


def test_its_virtual_robot_falls_towards_the_sag_of_the_model(shipped):
    """In the first second; it swings and creeps, and its modulus is drawn."""
    setup, _, shape = shipped
    virtual = VirtualRobot(
        setup.truth, setup.nominal, setup.virtual_hardware, seed=setup.seed, motion=StaticMotion(base_orientation(0.0))
    )
    tip = []
    for _ in range(50):
        virtual.step(0.02, [])
        tip.append(virtual.truth.tip_position)
    assert virtual.unresolved == 0
    tip, sag = np.array(tip), -shape.tip_position[0]
    assert np.isfinite(tip).all()
    assert 0.0 <= -tip[:, 0].min() < 2.5 * sag
    assert np.abs(tip[:, 1]).max() < 0.3 * sag


def test_the_readme_shows_every_shipped_robot():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    for name in ROBOTS:
        picture = f"src/doc/pictures/robots/{name}.png"
        assert f"(src/gravcomp/robots/{name}.yaml)" in text and f"({picture})" in text
        assert 2_000 < (ROOT / picture).stat().st_size < 60_000
