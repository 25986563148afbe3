"""Robots of another size, scaled by the units of their parameters."""

import numpy as np
import pytest

from gravcomp.closed_loop.setup import Setup
from gravcomp.description import ImuMount, load_robot_file
from gravcomp.simulation import Simulator
from gravcomp.trials.similarity import scaled, scaled_setup
from gravcomp.virtual.body import build_rod
from gravcomp.virtual.equilibrium import equilibrium

G = 9.81


@pytest.fixture(scope="module")
def setup():
    return Setup.of(load_robot_file("article"))


def test_every_parameter_is_scaled_by_its_unit(setup):
    double = scaled_setup(setup, 4.0)
    robot, own = double.robot, setup.robot
    assert robot.length == pytest.approx(4.0 * own.length) and robot.segments[0].lumen_diameter == pytest.approx(4.0 * 3.6e-3)
    assert robot.materials[0].youngs_modulus == pytest.approx(3.2e6) and robot.materials[0].density == own.materials[0].density
    assert robot.limits.tension_max == pytest.approx(64.0 * 5.0) and robot.limits.tension_rate == pytest.approx(32.0 * 20.0)
    assert robot.limits.displacement_rate == pytest.approx(2.0 * own.limits.displacement_rate)
    assert robot.cables[0].stiffness == pytest.approx(64.0 * own.cables[0].stiffness)
    assert double.hardware.drive.torque_constant == pytest.approx(256.0 * setup.hardware.drive.torque_constant)
    assert double.first_period == pytest.approx(2.0 * setup.first_period, rel=1e-6)


def test_a_scaled_robot_bends_alike(setup):
    gravity, tips, true = np.array([-G, 0.0, 0.0]), [], []
    for k in (1.0, 0.5, 4.0):
        other = scaled_setup(setup, k)
        tension = k**3 * np.array([0.2, 0.0, 0.0, 0.3, 0.0, 0.0])
        tips.append(Simulator(other.robot, reduced=False).solve(gravity, tension=tension).tip_position / k)
        true.append(equilibrium(build_rod(other.true_robot), gravity, tension=tension).tip / k)
    for found in (tips, true):
        assert found[1:] == [pytest.approx(found[0], abs=1e-7)] * 2


def test_the_numbers_of_a_tuple_are_scaled():
    mount = ImuMount(position=(1e-3, 0.0, -2e-3), rpy=(0.5, 0.0, 0.0))
    assert scaled(mount, 2.0) == ImuMount(position=(2e-3, 0.0, -4e-3), rpy=(0.5, 0.0, 0.0))
