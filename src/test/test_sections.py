"""Sections of any shape: their moments and torsion constant, tapers and transitions along the robot, channels that follow."""

import numpy as np
import pytest

from gravcomp.description import Cable, Elements, Lumen, Material, Outline, Robot, Section, Segment, Station, section_moments
from gravcomp.description.blended_outline import BlendedOutline
from gravcomp.full_model.wrench import Wrench
from gravcomp.mesh.torsion import torsion_constant
from gravcomp.simulation import RobotModel, Simulator

MATERIAL = Material(youngs_modulus=1e6, poissons_ratio=0.3, density=0.0)
THREE = (Lumen(2e-3, 2e-3), Lumen(2e-3, -1e-3, 1.8e-3), Lumen(1.5e-3, -1e-3, -1.8e-3))


@pytest.mark.parametrize(
    ("outline", "lumens", "expected"),
    [
        (Outline.circle(8e-3), (Outline.circle(3e-3),), np.pi / 32 * (8e-3**4 - 3e-3**4)),
        (Outline.circle(8e-3), (Outline.circle(3e-3, 1e-12),), np.pi / 32 * (8e-3**4 - 3e-3**4)),  # computed, not the closed form
        (Outline("ellipse", 4e-3, 2e-3), (), np.pi * 4e-3**3 * 2e-3**3 / (4e-3**2 + 2e-3**2)),
        # S. Timoshenko, J. N. Goodier, Theory of Elasticity, 1951, art. 94.
        (Outline("rectangle", 4e-3, 4e-3), (), 0.140577 * 8e-3**4),
        (Outline("rectangle", 4e-3, 2e-3), (), 0.228682 * 8e-3 * 4e-3**3),
    ],
)
def test_torsion_constants_are_those_of_the_closed_forms(outline, lumens, expected):
    assert torsion_constant(outline, lumens) == pytest.approx(expected, rel=3e-4)


def test_a_bar_with_three_lumens_bends_and_twists_as_its_section_says():
    bar = Segment("bar", 0.2, 8e-3, material=MATERIAL, lumens=THREE)
    robot = Robot("bar", segments=(bar,), elements=Elements(around=8, along=8, radial=2, grading=2.0))
    section = robot.pieces[0].moments(0.1)
    force, moment = 1e-5, 1e-7
    simulator = Simulator(robot, reduced=False)
    wrench = Wrench(force=[force, 0.0, 0.0], moment=[0.0, 0.0, moment])
    shape = simulator.solve(np.zeros(3), wrench=wrench)
    x, y = np.linalg.solve([[section.xx, section.xy], [section.xy, section.yy]], [force * 0.2**3 / 3e6, 0.0])
    assert shape.tip_position[:2] == pytest.approx([x, y], rel=0.01, abs=2e-3 * x)
    shear = 1e6 / (2 * 1.3)
    twist = 2 * shape.tip_orientation[2]
    torsion = torsion_constant(*robot.pieces[0].section(0.1))
    # The clamp keeps its end plane, and stiffens the bar a little.
    assert twist == pytest.approx(moment * 0.2 / (shear * torsion), rel=0.02)


def test_a_taper_over_stations_bends_as_beam_theory_says():
    stations = Station(0.0, 10e-3), Station(0.06, 6e-3), Station(0.2, 5e-3)
    robot = Robot(
        "bar", segments=(Segment("bar", 0.2, material=MATERIAL, stations=stations),),
        elements=Elements(around=8, along=12, radial=1, grading=1.0, equal_stiffness=True),
    )  # fmt: skip
    force = 1e-6
    shape = Simulator(robot, reduced=False).solve(np.zeros(3), wrench=Wrench(force=[force, 0.0, 0.0]))
    z = 0.2 * (np.arange(2000) + 0.5) / 2000
    second = np.array([robot.piece_at(s).moments(s).xx for s in z])
    assert shape.tip_position[0] == pytest.approx(force / 1e6 * np.mean((0.2 - z) ** 2 / second) * 0.2, rel=0.01)


def test_moments_are_about_the_centroid():
    one = section_moments(Outline("rectangle", 4e-3, 2e-3, 1e-3, -2e-3))
    assert (one.x, one.y, one.xy) == pytest.approx((1e-3, -2e-3, 0.0), abs=1e-15)
    assert one.xx == pytest.approx(4e-3 * 8e-3**3 / 12) and one.yy == pytest.approx(8e-3 * 4e-3**3 / 12)


def test_a_blend_of_two_outlines_lies_between_them():
    circle, square = Outline.circle(8e-3), Outline("rectangle", 4e-3, 4e-3)
    blend = BlendedOutline(circle, square, 0.5)
    assert circle.area < blend.area < square.area
    corner = 0.5 * (4e-3 / np.sqrt(2) + 4e-3)
    assert blend.boundary(np.array([np.pi / 4]))[0] == pytest.approx([corner, corner])
    assert blend.gauge(corner, corner) == pytest.approx(1.0, abs=1e-4)
    assert blend.reach(0.0, 0.0, np.array([0.0, np.pi / 4])) == pytest.approx([4e-3, np.hypot(corner, corner)], rel=1e-4)
    assert blend.parameter(corner, -corner) % (2 * np.pi) == pytest.approx(np.radians(315), abs=1e-3)


def test_segments_of_different_section_meet_in_a_transition():
    tube = Segment("tube", 0.05, 10e-3, 3e-3)
    block = Segment("block", 0.05, section=Section("rectangle", 10e-3, 8e-3), lumens=(Lumen(2e-3, 1e-3),), transition=5e-3)
    transition = Robot("r", segments=(tube, block)).pieces[1]
    assert transition.name == "block, transition" and (transition.start, transition.length) == (0.05, 5e-3)
    outline, lumens = transition.section(0.0525)
    assert outline.half_height == pytest.approx(4.5e-3) and lumens[0].half_width == pytest.approx(1.25e-3)
    assert lumens[0].x == pytest.approx(0.5e-3)
    solid = Robot("r", segments=(tube, Segment("block", 0.05, section=block.section))).pieces[1]
    assert solid.lumens == ()  # the lumen ends where the segments meet
    assert len(Robot("r", segments=(tube, Segment("thin", 0.05, 6e-3))).pieces) == 2  # round, concentric: a step


def test_a_cable_follows_the_taper_over_stations_and_steps():
    segments = (
        Segment("a", 0.1, stations=(Station(0.0, 20e-3), Station(0.04, 10e-3))),
        Segment("b", 0.1, 8e-3, tip_outer_diameter=4e-3),
    )
    cable = Cable("c", 0.0, 6e-3, segment="b", follow_taper=True)
    robot = Robot("r", segments=segments, cables=(cable,), elements=Elements(around=8, along=10, radial=2))
    radii = [robot.cable_place(robot.cables[0], s)[0] for s in (0.0, 0.02, 0.04, 0.1, 0.15, 0.2)]
    assert radii == pytest.approx([6e-3, 4.5e-3, 3e-3, 3e-3, 2.25e-3, 1.5e-3])
    length = np.hypot(0.04, 3e-3) + 0.06 + np.hypot(0.1, 1.5e-3)
    assert RobotModel(robot).tendons.rest_length == pytest.approx([length], rel=1e-9)
    with pytest.raises(ValueError, match="follow_taper and also tip_radius_mm"):
        Cable("c", 0.0, 6e-3, tip_radius=3e-3, segment="b", follow_taper=True)
