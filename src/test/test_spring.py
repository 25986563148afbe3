"""A helical spring as backbone: stiffness and mass of the tube in its place, and springs that are refused."""

import numpy as np
import pytest

from gravcomp.contact.surface import contact_surface
from gravcomp.description import Elements, Material, Robot, Segment, Spring
from gravcomp.full_model.wrench import Wrench
from gravcomp.simulation import Simulator
from gravcomp.view.skin import half_width
from gravcomp.view.wall import lumen_skin, wall_skins


def test_a_spring_bends_and_gets_shorter_as_the_formulas_of_springs_say():
    steel = Material(youngs_modulus=200e9, poissons_ratio=0.3, density=7850.0)
    length, wire, pitch, radius = 0.15, 1e-3, 2.5e-3, 3.5e-3
    segment = Segment("s", length, 8e-3, material=steel, spring=Spring(wire, pitch))
    elements = Elements(around=8, along=10, grading=1.0, equal_stiffness=True)
    robot = Robot("spring", segments=(segment,), elements=elements)
    force, shear = 1e-3, 200e9 / 2.6
    rate = shear * wire**4 / (8 * (2 * radius) ** 3 * (length / pitch))  # of a helical spring, N/m
    pushed = Simulator(robot, reduced=False).solve(np.zeros(3), wrench=Wrench(force=[0.0, 0.0, -force]))
    assert length - pushed.tip_position[2] == pytest.approx(force / rate, rel=0.01)
    inertia = np.pi / 64 * wire**4
    bending = pitch * 200e9 * inertia / (np.pi * radius * 2.3)  # Timoshenko and Gere, with G J = E I / 1.3
    across = Simulator(robot, reduced=False).solve(np.zeros(3), wrench=Wrench(force=[0.1 * force, 0.0, 0.0]))
    assert across.tip_position[0] == pytest.approx(0.1 * force * length**3 / (3 * bending), rel=0.02)
    turns = length / pitch
    mass = 7850 * np.pi / 4 * wire**2 * turns * np.hypot(2 * np.pi * radius, pitch)
    assert Simulator(robot, reduced=False).model.mass == pytest.approx(mass, rel=1e-3)


def test_a_spring_is_touched_and_seen_where_its_coils_are_not_where_the_tube_would_be():
    robot = Robot("spring", segments=(Segment("s", 0.15, 8e-3, spring=Spring(1e-3, 2.5e-3)),))
    assert robot.pieces[0].outer[0].half_width > 6e-3  # the tube
    surface = contact_surface(robot)
    assert surface.radius == pytest.approx(np.full(len(surface.radius), 4e-3))
    (wall,) = wall_skins(robot)
    lumen = lumen_skin(robot)
    assert np.hypot(*wall.offset.T).max() == pytest.approx(4e-3) and half_width(robot) == pytest.approx(4e-3)
    assert np.hypot(*lumen.offset.T) == pytest.approx(np.full(len(lumen.offset), 3e-3))


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"spring": Spring(1e-3, 1e-3)}, "coils touch"),
        ({"spring": Spring(3e-3, 4e-3)}, "wire_diameter_mm is 3; allowed: up to a third"),
        ({"spring": Spring(1e-3, 2e-3), "lumen_diameter": 6e-3}, "spring and also lumen_diameter_mm"),
    ],
)
def test_a_spring_that_is_none_is_refused(more, words):
    with pytest.raises(ValueError, match=words):
        Segment("s", 0.1, 8e-3, **more)
