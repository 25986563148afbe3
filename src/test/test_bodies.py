"""Bodies of any slender shape: they rest where they are described, weigh what they should, and bend as rods do."""

import contextlib
import csv
import dataclasses
import math

import numpy as np
import pytest

from gravcomp.cables.disks import disk_heights
from gravcomp.config import ConfigError, from_mapping
from gravcomp.description import (
    Cable,
    Cap,
    Disks,
    Elements,
    Lumen,
    Material,
    MeshBody,
    RestShape,
    Robot,
    Section,
    Segment,
    Station,
)
from gravcomp.experiments.measured import default_folder
from gravcomp.full_model import mesh_choice, mesh_error, mesh_loads
from gravcomp.full_model.carried_shape import carried_shape
from gravcomp.full_model.mesh_choice import chosen_mesh
from gravcomp.full_model.mesh_error import error_of_mesh
from gravcomp.full_model.model import MeshedModel
from gravcomp.full_model.modes import natural_frequencies
from gravcomp.full_model.statics import StaticSolver
from gravcomp.full_model.wrench import Wrench
from gravcomp.mesh import Mesh, MeshError, tube_mesh
from gravcomp.mesh.elements import shape_gradients, stiffness_quadrature
from gravcomp.mesh.embedding import embed
from gravcomp.mesh.quality import mesh_quality
from gravcomp.mesh.refusal import well_shaped
from gravcomp.mesh.robot_axis import rest_axis
from gravcomp.mesh.tube import coarse_elements
from gravcomp.simulation import RobotModel, ShapeStatus, Simulator


def random_robot(seed: int) -> Robot:
    """A tube or bar with a cable anywhere in its wall, of one of eight kinds of body."""
    rng = np.random.default_rng(seed)
    length, wall, lumen = rng.uniform(5e-3, 0.5), np.exp(rng.uniform(np.log(0.3e-3), np.log(10e-3))), rng.uniform(0.5e-3, 10e-3)
    outer = lumen + 2 * wall
    taper = {"tip_outer_diameter": lumen + 1.2 * wall}
    rest = RestShape(rng.uniform(0.1, min(2.5, 0.8 * length / outer)), rng.uniform(-3, 3))
    turn, share = rng.uniform(-3, 3), rng.uniform(0.6, 1.0)
    shift = 0.5 * wall * np.array([np.cos(seed), np.sin(seed)])
    places = 0.25 * outer * np.array([[np.cos(turn + k), np.sin(turn + k)] for k in (0.0, 2.1, 4.0)])
    several = tuple(Lumen(0.2 * outer * size, x, y, seed % 3 == 0) for (x, y), size in zip(places, (1.0, 0.7, share)))
    stations = Station(0.3 * length, share * outer, share * lumen), Station(0.7 * length, 0.5 * (lumen + outer))
    segments = {
        0: [Segment("a", length, outer, lumen)],
        1: [Segment("a", length, outer, lumen, tip_outer_diameter=share * outer, tip_lumen_diameter=share * lumen)],
        2: [Segment("a", length, outer, lumens=(Lumen(lumen, *shift),))],
        3: [Segment("a", length, outer, lumen, rest=rest, **(taper if seed % 16 == 3 else {}))],
        4: [Segment("a", length, outer, lumen, stations=stations)],
        5: [Segment("a", length, outer, lumens=several, **(taper if seed % 3 == 0 else {}))],
        6: [
            Segment("a", 0.4 * length, outer, lumen),
            Segment("b", 0.6 * length, section=Section("rectangle", outer, share * outer), lumen_diameter=0.5 * lumen),
        ],
        7: [Segment("a", 0.5 * length, outer, lumens=several, rest=rest), Segment("b", 0.5 * length, outer)],
    }[seed % 8]
    elements = Elements(around=6, along=8, radial=2, grading=2.0)
    if seed % 8 == 6:
        robot = Robot("random", segments=tuple(segments))
        elements = well_shaped(robot, coarse_elements(robot))
    angle = rng.uniform(-3, 3)
    for part in np.linspace(0.0, 1.0, 21):  # the first place in the wall on a ray from the axis
        with contextlib.suppress(ValueError):
            cable = Cable("any", angle, part * outer / 2, segment=segments[-1].name, follow_taper=seed % 8 == 1)
            return Robot("random", segments=tuple(segments), cables=(cable,), elements=elements)
    raise AssertionError("no place for the cable")


@pytest.mark.parametrize("seed", range(16))
def test_a_robot_without_load_rests_where_it_is_described(seed):
    robot = random_robot(seed)
    simulator = Simulator(robot, reduced=False)
    shape = simulator.solve(np.zeros(3))
    axis = rest_axis(robot)
    station = np.append(shape.backbone_station, 1.0) * robot.length
    position, rotation = axis.frames(station)
    assert shape.status == ShapeStatus.OK
    assert shape.backbone_position == pytest.approx(position[:-1], abs=1e-9 * robot.length)
    assert shape.tip_position == pytest.approx(position[-1], abs=1e-9 * robot.length)
    assert shape.tip_direction == pytest.approx(rotation[-1, :, 2], abs=1e-6)


THREE = (Lumen(2e-3, 2e-3), Lumen(2e-3, -1e-3, 1.8e-3), Lumen(1.5e-3, -1e-3, -1.8e-3))
FOLLOWING = tuple(dataclasses.replace(lumen, follow_taper=True) for lumen in THREE)
TURNED = tuple(Lumen(2e-3, 2e-3 * np.cos(angle), 2e-3 * np.sin(angle)) for angle in np.radians([60, 240]))
FOUR = tuple(Lumen(0.8e-3, 2.6e-3 * np.cos(angle), 2.6e-3 * np.sin(angle)) for angle in np.radians([0, 90, 180, 270]))
BLOCK = Section("rectangle", 10e-3, 8e-3)
BODIES = {
    "solid": (Segment("a", 0.1, 9e-3),),
    "solid, tapered": (Segment("a", 0.1, 9e-3, tip_outer_diameter=5e-3),),
    "tube, tapered": (Segment("a", 0.1, 9e-3, 3e-3, tip_outer_diameter=6e-3, tip_lumen_diameter=2e-3),),
    "tube on bar": (Segment("a", 0.03, 9e-3), Segment("b", 0.03, 9e-3, 3e-3)),
    "steps": (Segment("a", 0.03, 9e-3), Segment("b", 0.03, 7e-3, 3e-3), Segment("c", 0.03, 5e-3, cap=Cap(2e-3, Material()))),
    "step and taper": (Segment("a", 0.03, 10e-3, 4e-3), Segment("b", 0.03, 8e-3, 4e-3, tip_outer_diameter=6e-3)),
    "rectangle": (Segment("a", 0.1, section=Section("rectangle", 10e-3, 4e-3)),),
    "ellipse": (Segment("a", 0.1, section=Section("ellipse", 10e-3, 6e-3, tip_width=6e-3)),),
    "rectangle with a lumen": (Segment("a", 0.1, section=Section("rectangle", 10e-3, 8e-3), lumen_diameter=3e-3),),
    "lumen off the axis": (Segment("a", 0.1, 9e-3, lumens=(Lumen(3e-3, 1e-3, 0.5e-3),)),),
    "three lumens": (Segment("a", 0.1, 8e-3, lumens=THREE, cap=Cap(2e-3, Material())),),
    "three lumens, tapered": (Segment("a", 0.1, 8e-3, tip_outer_diameter=5e-3, lumens=FOLLOWING),),
    "three lumens on a bar": (Segment("a", 0.05, 8e-3), Segment("b", 0.05, 8e-3, lumens=THREE)),
    "lumens around a lumen": (Segment("a", 0.05, 8e-3, 2.4e-3, lumens=FOUR), Segment("b", 0.05, 8e-3, 2.4e-3)),
    "stations": (Segment("a", 0.1, stations=(Station(0.0, 10e-3), Station(0.04, 8e-3), Station(0.1, 5e-3))),),
    "stations of a rectangle": (Segment("a", 0.1, section=BLOCK, stations=(Station(0.05, width=6e-3, height=7e-3),)),),
    "round to rectangle": (Segment("a", 0.05, 10e-3, 3e-3), Segment("b", 0.05, section=BLOCK)),
    "rectangle to thin tube": (Segment("a", 0.05, section=BLOCK, lumen_diameter=3e-3), Segment("b", 0.05, 5e-3, 2e-3)),
    "lumen that changes its place": (
        Segment("a", 0.05, 8e-3, lumens=(Lumen(2e-3, 1e-3),)),
        Segment("b", 0.05, 8e-3, lumens=(Lumen(2e-3, -1e-3),), transition=4e-3),
    ),
    "bent": (Segment("a", 0.1, 9e-3, 3e-3, rest=RestShape(2.0, 0.5)), Segment("b", 0.05, 9e-3, 3e-3, rest=RestShape(-1.0))),
}


@pytest.mark.parametrize("name", BODIES)
def test_bodies_have_their_volume_and_no_bad_elements(name):
    robot = Robot("body", segments=BODIES[name], elements=Elements(around=12, along=12, radial=2, grading=2.0))
    mesh = tube_mesh(robot)
    x, w = np.polynomial.legendre.leggauss(3)
    volume = sum(
        0.5 * piece.length * weight * piece.moments(piece.start + 0.5 * (1 + part) * piece.length).area
        for piece in robot.pieces
        for part, weight in zip(x, w)
    )
    assert volume_of(mesh) == pytest.approx(volume, rel=4e-4)
    assert mesh_quality(mesh).jacobian_ratio > 0.15


def volume_of(mesh: Mesh) -> float:
    """Volume (m^3) of the elements."""
    rule = stiffness_quadrature(mesh.kind)
    gradient = shape_gradients(mesh.kind, rule.points)
    jacobian = np.einsum("kai,paj->kpij", mesh.nodes[mesh.elements], gradient)
    return float((np.linalg.det(jacobian) @ rule.weights).sum())


@pytest.mark.parametrize(
    ("section", "moment"),
    [
        ({"outer_diameter": 8e-3}, np.pi / 64 * 8e-3**4),
        ({"section": Section("rectangle", 4e-3, 8e-3)}, 8e-3 * 4e-3**3 / 12),
        ({"section": Section("ellipse", 4e-3, 8e-3)}, np.pi / 64 * 8e-3 * 4e-3**3),
        ({"outer_diameter": 8e-3, "lumens": (Lumen(3e-3, 0.0, 1.5e-3),)}, np.pi / 64 * (8e-3**4 - 3e-3**4)),
    ],
)
def test_small_forces_at_the_tip_bend_a_bar_as_beam_theory_says(section, moment):
    bar = Segment("bar", 0.2, material=Material(youngs_modulus=1e6, poissons_ratio=0.3, density=0.0), **section)
    robot = Robot("bar", segments=(bar,), elements=Elements(around=8, along=10, radial=2, grading=1.0, equal_stiffness=True))
    force = 1e-5
    shape = Simulator(robot, reduced=False).solve(np.zeros(3), wrench=Wrench(force=[force, 0.0, 0.0]))
    # Shear adds 3 E I / (k G A L^2), well below 1 %.
    assert shape.tip_position[0] == pytest.approx(force * 0.2**3 / (3 * 1e6 * moment), rel=0.01)


def test_a_moment_at_the_tip_bends_a_bar_into_a_circle():
    material = Material(youngs_modulus=1e6, poissons_ratio=0.0, density=0.0)
    bar = Segment("bar", 0.2, 4e-3, material=material)
    robot = Robot("bar", segments=(bar,), elements=Elements(around=4, along=10, grading=1.0, equal_stiffness=True))
    stiffness = 1e6 * np.pi / 64 * 4e-3**4
    moment = stiffness * 0.8 / 0.2  # the tip turns by 0.8 rad
    shape = Simulator(robot, reduced=False).solve(np.zeros(3), wrench=Wrench(moment=[0.0, moment, 0.0]))
    assert shape.status == ShapeStatus.OK
    assert shape.tip_direction == pytest.approx([np.sin(0.8), 0.0, np.cos(0.8)], abs=4e-3)
    assert shape.tip_position == pytest.approx(0.25 * np.array([1 - np.cos(0.8), 0.0, np.sin(0.8)]), abs=1e-3)


def disk_robot(case: dict, along: int) -> Robot:
    """A robot of the table: a steel backbone whose disks guide three cables a segment, without weight."""
    number = {key: float(value) for key, value in case.items() if key != "model"}
    material = Material(youngs_modulus=number["youngs_modulus_pa"], poissons_ratio=0.3, density=0.0)
    segments, cables = [], []
    for j in (1, 2):
        disks = Disks(int(number[f"disks{j}"]), 2.5 * number[f"pitch{j}_m"])
        segments.append(Segment(f"s{j}", number[f"length{j}_m"], 2 * number["backbone_radius_m"], material=material, disks=disks))
        for angle in (90.0, -30.0, 210.0):
            cables.append(Cable(f"c{len(cables)}", np.radians(angle), number[f"pitch{j}_m"], segment=f"s{j}"))
    elements = Elements(around=4, along=along, grading=1.0, equal_stiffness=True)
    return Robot("disks", segments=tuple(segments), cables=tuple(cables), elements=elements)


def disk_cases():
    """Rows of tips that others computed (P. Rao et al., "How to model tendon-driven continuum robots and benchmark modelling
    performance", Front. Robot. AI 2021), from the folder of measurements; none where it is missing."""
    tips = default_folder() / "disks" / "tips.csv"
    if not tips.exists():
        return []
    with tips.open(encoding="utf-8") as file:
        return [row for row in csv.DictReader(file) if row["model"] == "straight_between_disks"][:3]


@pytest.mark.slow
@pytest.mark.parametrize("case", disk_cases(), ids=lambda case: f"case {case['case']}")
def test_a_backbone_with_disks_goes_where_others_compute(case):
    robot = disk_robot(case, along=40)
    tension = [float(case[f"t{i}_n"]) for i in range(1, 7)]
    wrench = Wrench(force=[float(case[f"f{axis}_n"]) for axis in "xyz"])
    shape = Simulator(robot, reduced=False).solve(np.zeros(3), tension=tension, wrench=wrench)
    expected = [float(case[f"p{axis}_m"]) for axis in "xyz"]
    assert shape.status == ShapeStatus.OK
    assert np.linalg.norm(shape.tip_position - expected) < 3e-3 * robot.length


def test_disks_are_weighed_and_slow_the_robot_down():
    segment = Segment("a", 0.1, 2e-3, material=Material(youngs_modulus=50e6), disks=Disks(4, 20e-3, mass=1e-3))
    robot = Robot("disks", segments=(segment,), elements=Elements(around=4, along=8))
    assert disk_heights(robot) == pytest.approx([0.0, 0.025, 0.05, 0.075, 0.1])
    model = RobotModel(robot)
    bare = RobotModel(dataclasses.replace(robot, segments=(dataclasses.replace(segment, disks=None),)))
    assert model.mass == pytest.approx(bare.mass + 4e-3)
    assert natural_frequencies(model, 1)[0] < 0.5 * natural_frequencies(bare, 1)[0]


@pytest.mark.parametrize(
    ("segment", "words"),
    [
        ({}, "neither of outer_diameter_mm"),
        ({"outer_diameter_mm": 9, "section": {"shape": "ellipse", "width_mm": 4, "height_mm": 6}}, "both outer_diameter_mm"),
        ({"outer_diameter_mm": 9, "tip_outer_diameter_mm": 0}, "0.05 to 1000 mm"),
        ({"outer_diameter_mm": 9, "lumen_diameter_mm": 4, "tip_outer_diameter_mm": 4}, "below 0.98 x tip_outer_diameter_mm"),
        ({"outer_diameter_mm": 9, "lumens": [{"diameter_mm": 3, "x_mm": 4}]}, "does not lie inside the outline"),
        ({"outer_diameter_mm": 9, "lumens": [{"diameter_mm": 3, "x_mm": 1}, {"diameter_mm": 3}]}, "touch or overlap"),
        ({"outer_diameter_mm": 9, "lumen_diameter_mm": 3, "lumens": [{"diameter_mm": 2, "x_mm": 2}]}, "touch or overlap"),
        ({"outer_diameter_mm": 9, "tip_outer_diameter_mm": 4, "lumens": [{"diameter_mm": 2, "x_mm": 2}]}, "does not lie inside"),
        ({"outer_diameter_mm": 9, "rest": {"bend_angle_deg": 360}, "length_mm": 20}, "radius of 3.18 mm"),
        ({"outer_diameter_mm": 9, "disks": {"count": 4, "outer_diameter_mm": 8}}, "above the width of the backbone"),
        ({"outer_diameter_mm": 2, "disks": {"count": 200, "outer_diameter_mm": 8}}, "up to the segment's length"),
        ({"outer_diameter_mm": 2, "disks": {"spacing_mm": 120, "outer_diameter_mm": 8}}, "spacing_mm is 120; allowed: up to the"),
        ({"outer_diameter_mm": 2, "disks": {"outer_diameter_mm": 8}}, "neither of count and spacing_mm"),
        ({"outer_diameter_mm": 9, "stations": [{"z_mm": 50, "outer_diameter_mm": 0}]}, "0.05 to 1000 mm"),
        (
            {"outer_diameter_mm": 9, "stations": [{"z_mm": 50, "outer_diameter_mm": 8}, {"z_mm": 40, "outer_diameter_mm": 7}]},
            r"stations\[1\].z_mm is 40; allowed: above that of the station before, 50",
        ),
        ({"outer_diameter_mm": 9, "stations": [{"z_mm": 120, "outer_diameter_mm": 8}]}, r"z_mm is 120; allowed: up to .*, 100"),
        ({"outer_diameter_mm": 9, "stations": [{"z_mm": 0, "outer_diameter_mm": 8}]}, "the segment's base a second time"),
        (
            {"outer_diameter_mm": 9, "tip_outer_diameter_mm": 5, "stations": [{"z_mm": 100, "outer_diameter_mm": 8}]},
            "the segment's tip a second time",
        ),
        ({"outer_diameter_mm": 9, "stations": [{"z_mm": 50}]}, "gives no size"),
        ({"outer_diameter_mm": 9, "stations": [{"z_mm": 50, "width_mm": 8}]}, "the segment is round: use outer_diameter_mm"),
        ({"outer_diameter_mm": 9, "stations": [{"z_mm": 50, "lumen_diameter_mm": 3}]}, "no lumen_diameter_mm at its base"),
        (
            {"outer_diameter_mm": 9, "lumen_diameter_mm": 4, "stations": [{"z_mm": 50, "outer_diameter_mm": 4}]},
            "is 4 at 50 mm; allowed: below 0.98 x outer_diameter_mm",
        ),
    ],
)
def test_a_segment_that_cannot_be_is_refused(segment, words):
    with pytest.raises(ConfigError, match=words):
        from_mapping(Segment, {"name": "a", "length_mm": 100} | segment, source="robot.yaml", key="segments[0]")


@pytest.mark.parametrize(
    ("segments", "cable", "words"),
    [
        ((Segment("a", 0.1, 9e-3, lumens=(Lumen(5e-3, 1e-3),)), Segment("b", 0.1, 2e-3)), None, "fits into the other's lumen"),
        ((Segment("a", 0.1, 9e-3), Segment("b", 0.1, section=BLOCK, transition=0.2)), None, "allowed: below its length, 100 mm"),
        (
            (Segment("a", 0.1, 8e-3, lumens=THREE), Segment("b", 0.1, section=BLOCK, lumens=THREE[1:] + THREE[:1])),
            None,
            "lumens go on in the order in which they are listed",
        ),
        ((Segment("a", 0.1, 8e-3, lumens=THREE),), (2e-3, 0.0), "in its lumen, circle of 2 mm at"),
        ((Segment("a", 0.1, 9e-3, stations=(Station(0.06, 4e-3),)),), (3e-3, 0.0), "within its wall, 0 to 2 mm"),
        ((Segment("a", 0.1, 9e-3, 5e-3), Segment("b", 0.1, 4e-3)), None, "do not touch"),
        ((Segment("a", 0.1, 9e-3, lumens=(Lumen(3e-3, 2e-3),)),), (2e-3, 0.0), "in its lumen, circle of 3 mm at"),
        (
            (Segment("a", 0.1, section=Section("rectangle", 8e-3, 4e-3)),),
            (3e-3, 90.0),
            "outside its outline, rectangle of 8 x 4 mm",
        ),
        ((Segment("a", 0.1, 2e-3, disks=Disks(4, 20e-3)),), (11e-3, 0.0), "inside its disks, up to 10 mm"),
        ((Segment("a", 0.1, 2e-3, disks=Disks(4, 20e-3)),), (0.5e-3, 0.0), "outside its backbone"),
        ((Segment("a", 0.1, 9e-3, tip_outer_diameter=3e-3),), (3e-3, 0.0), "within its wall, 0 to 1.5 mm"),
    ],
)
def test_a_robot_that_cannot_be_is_refused(segments, cable, words):
    cables = (Cable("c", np.radians(cable[1]), cable[0], segment="a"),) if cable else ()
    with pytest.raises(ValueError, match=words):
        Robot("robot", segments=segments, cables=cables)


@pytest.mark.parametrize(
    ("robot", "words"),
    [
        (Robot("r", segments=(Segment("a", 0.1, 9e-3),), elements=Elements(around=6)), "use 8 or 12"),
        (
            Robot("r", segments=(Segment("a", 0.1, 8e-3, lumens=THREE), Segment("b", 0.1, 8e-3, lumens=TURNED))),
            "Lumens that end and others that begin must lie apart",
        ),
        (
            Robot("r", segments=(Segment("a", 0.1, 2e-3, disks=Disks(12, 20e-3)),), elements=Elements(around=4)),
            "12 distances between disks",
        ),
    ],
)
def test_a_body_that_cannot_be_meshed_is_named(robot, words):
    with pytest.raises(MeshError, match=words):
        tube_mesh(robot)


def test_cables_that_cross_are_refused_and_those_that_share_a_channel_are_not():
    segments = (Segment("a", 0.1, 9e-3), Segment("b", 0.1, 9e-3))
    straight = Cable("straight", 0.0, 3e-3, segment="a")
    across = Cable("across", via_points=((3e-3, -2e-3, 0.0), (3e-3, 2e-3, 0.1)))
    with pytest.raises(ValueError, match="'straight' and 'across' cross at 50 mm along the robot"):
        Robot("r", segments=segments, cables=(straight, across))
    assert Robot("r", segments=segments, cables=(straight, dataclasses.replace(straight, name="longer", segment="b")))
    meeting = dataclasses.replace(across, via_points=((3e-3, -2e-3, 0.0), (3e-3, 0.0, 0.1)))
    assert Robot("r", segments=segments, cables=(straight, meeting))


def test_cables_in_a_body_from_a_file_do_not_cross_either():
    def robot(*cables):
        return Robot("r", body=MeshBody("not_read.stl", length=0.1), cables=cables)

    straight, over = Cable("straight", 0.0, 3e-3, end=0.1), Cable("over", 0.0, 3e-3, end=0.1)
    across = Cable("across", via_points=((3e-3, -2e-3, 0.0), (3e-3, 2e-3, 0.08)))
    with pytest.raises(ValueError, match="'straight' and 'across' cross at 40 mm along the robot"):
        robot(straight, across)
    with pytest.raises(ValueError, match="'straight' and 'over' are the same line"):
        robot(straight, over)
    assert robot(straight, dataclasses.replace(over, end=0.05), Cable("opposite", math.pi, 3e-3, end=0.1))


def test_a_cable_between_two_via_points_does_not_pass_a_lumen():
    segments = (Segment("a", 0.1, 9e-3, 3e-3),)
    cable = Cable("c", via_points=((3e-3, 0.0, 0.0), (-3e-3, 0.0, 0.1)))
    with pytest.raises(ValueError, match=r"within its wall, 1\.5 to 4\.5 mm"):
        Robot("r", segments=segments, cables=(cable,))


def test_disks_lie_at_multiples_of_their_spacing_and_at_the_end():
    assert Disks(None, 20e-3, spacing=0.03).heights(0.1) == pytest.approx([0.03, 0.06, 0.09, 0.1])
    assert Disks(None, 20e-3, spacing=0.025).heights(0.1) == pytest.approx([0.025, 0.05, 0.075, 0.1])
    assert Disks(None, 20e-3, spacing=0.1).heights(0.1) == pytest.approx([0.1])


def test_a_cable_that_ends_between_disks_is_refused():
    segment = Segment("a", 0.1, 2e-3, disks=Disks(4, 20e-3))
    cable = Cable("c", 0.0, 8e-3, end=0.06)
    with pytest.raises(MeshError, match="ends at 60 mm, between two disks; there are disks at 0, 25, 50, 75, 100 mm"):
        RobotModel(Robot("r", segments=(segment,), cables=(cable,), elements=Elements(around=4, along=8)))


def test_a_point_outside_is_refused_with_its_distance():
    mesh = tube_mesh(Robot("r", segments=(Segment("a", 0.1, 9e-3, 3e-3),), elements=Elements()))
    with pytest.raises(MeshError, match=r"the point \(12, 0, 50\) mm lies 7.5 mm outside the body"):
        embed(mesh, np.array([[12e-3, 0.0, 50e-3]]))


def test_a_cable_follows_the_taper():
    segment = Segment("a", 0.1, 10e-3, 4e-3, tip_outer_diameter=6e-3, tip_lumen_diameter=2e-3)
    cable = Cable("c", 0.0, 3.5e-3, tip_radius=2e-3, segment="a")
    model = RobotModel(Robot("r", segments=(segment,), cables=(cable,), elements=Elements(along=9)))
    assert model.tendons.rest_length == pytest.approx([np.hypot(0.1, 1.5e-3)], rel=1e-9)


def test_hexahedra_do_not_lock_when_the_material_is_nearly_incompressible():
    """The horizontal tube of 100 mm: a mesh twice as fine gives 28.83 mm at Poisson's ratio 0.4999."""
    material = Material(youngs_modulus=0.8e6, poissons_ratio=0.4999, density=1150.0)
    robot = Robot("tube", segments=(Segment("a", 0.1, 9e-3, 3e-3, material=material),), elements=Elements())
    assert Simulator(robot, reduced=False).solve([-9.81, 0.0, 0.0]).tip_position[0] == pytest.approx(-28.83e-3, abs=0.1e-3)


def test_the_chosen_mesh_reaches_its_accuracy(monkeypatch, tmp_path):
    monkeypatch.setenv("GRAVCOMP_CACHE", str(tmp_path))
    material = Material(youngs_modulus=3e6, poissons_ratio=0.45)
    robot = Robot("tube", segments=(Segment("a", 0.08, 10e-3, 4e-3, material=material),))
    choice = chosen_mesh(robot)
    assert choice.error < 1e-3
    assert error_of_mesh(robot) < 1.2e-3  # also the robot that is twice as stiff as the one for which the mesh was chosen
    assert len(list(tmp_path.rglob("*.json"))) == 1 and chosen_mesh(robot) == choice


def test_the_choice_of_a_mesh_ends_with_an_estimate_when_it_has_cost_as_much_as_it_may(monkeypatch, tmp_path, caplog):
    monkeypatch.setenv("GRAVCOMP_CACHE", str(tmp_path))
    monkeypatch.setattr(mesh_choice, "_MOST_WORK", 0.0)
    monkeypatch.setattr(mesh_choice, "ACCURACY", 1e-6)
    solved: list[Elements] = []

    def counted(model, loads, near=None):
        solved.append(model.robot.elements)
        return mesh_loads.shapes_under(model, loads, near)

    monkeypatch.setattr(mesh_choice, "shapes_under", counted)
    material = Material(youngs_modulus=3e6, poissons_ratio=0.45)
    choice = chosen_mesh(Robot("tube", segments=(Segment("a", 0.08, 10e-3, 4e-3, material=material),)))
    assert choice.error > 1e-6 and "leaves an estimated error" in caplog.text
    assert len(solved) < 10  # without a bound it goes on up to 15,000 unknowns


def test_the_error_of_a_mesh_ends_with_an_answer_or_a_reason(monkeypatch):
    """However large the finer mesh is, and however far a load is from an equilibrium."""
    robot = Robot("tube", segments=(Segment("a", 0.05, 8e-3, 3e-3),), elements=Elements(around=6, along=5))
    monkeypatch.setattr(mesh_error, "_MOST_WORK", 1e6)
    with pytest.raises(MeshError, match=r"unknowns in .* levels: .* the error is not measured"):
        error_of_mesh(robot)

    class Creeping(StaticSolver):
        """Finds an equilibrium only near the last one, each time a little less near."""

        tried = 0

        def track(self, gravity, *args, **kwargs):
            self.tried += 1
            return dataclasses.replace(self.state, converged=self.tried % 2 == 0)

    solver = Creeping(RobotModel(robot))
    assert not mesh_loads._follow(solver, mesh_loads.MeshLoad("heavy", np.array([1.0, 0.0, 0.0]), np.zeros(0)))
    assert solver.tried <= 40


def lost_when_horizontal(calls):
    """Return a `shapes_under` that finds the weight's shape on the first mesh only, and writes unknowns and steps to `calls`."""

    def found(model, loads, near=None, steps=None):
        calls.append((model.pattern.n, steps))
        rest = np.zeros_like(model.mesh.nodes)
        first = model.pattern.n == calls[0][0]
        return mesh_loads.LoadedShapes(model, tuple(rest if first or load.tension.any() else None for load in loads))

    return found


def test_a_load_that_the_finer_mesh_does_not_carry_is_sought_by_way_of_meshes_between_and_then_given_up(monkeypatch):
    robot = Robot("tube", segments=(Segment("a", 0.05, 8e-3, 3e-3),), elements=Elements(around=6, along=5))
    calls, stages = [], []
    monkeypatch.setattr(mesh_error, "shapes_under", lost_when_horizontal(calls))
    monkeypatch.setattr(mesh_error, "_MOST_TO_FOLLOW", 7e9)  # 35 steps on the first of the meshes between
    with pytest.raises(MeshError, match="the finer mesh finds no equilibrium under the load 'horizontal'"):
        error_of_mesh(robot, stages.append)
    unknowns, steps = zip(*calls)
    assert len(calls) == 5 and unknowns[0] < unknowns[2] < unknowns[3] < unknowns[1] == unknowns[4]  # less tension is no help
    assert steps[1] == 0 and 40 > steps[2] > steps[3] > steps[4] > 0  # the larger a mesh, the fewer
    assert stages[-1].startswith("load 'horizontal', ") and len(stages) == 4


def test_the_tension_is_not_made_smaller_for_another_load_without_equilibrium(monkeypatch):
    cable = Cable("c", 0.0, 3e-3, segment="a")
    robot = Robot("tube", segments=(Segment("a", 0.05, 8e-3, 3e-3),), cables=(cable,), elements=Elements(around=6, along=5))
    loads = [mesh_loads.MeshLoad("horizontal", np.array([-9.81, 0.0, 0.0]), np.zeros(1))]
    loads.append(mesh_loads.MeshLoad("bent", np.zeros(3), np.ones(1)))
    calls = []
    monkeypatch.setattr(mesh_choice, "mesh_loads", lambda model: loads)
    monkeypatch.setattr(mesh_choice, "shapes_under", lost_when_horizontal(calls))
    tips = mesh_choice._Tips(robot, robot.elements)
    change = tips.change(robot.elements, dataclasses.replace(robot.elements, along=7))
    assert np.isnan(change[0]).all() and change[1] == pytest.approx(np.zeros(3), abs=1e-9)
    assert len(calls) == 2  # each mesh once


def test_a_shape_is_carried_to_another_mesh():
    def field(place):
        x, y, z = place.T
        return np.column_stack([z**2 - 3.0 * x * y, z * y + x**2 * z, -2.0 * z * x + z**3])

    segment = Segment("a", 0.1, 12e-3, 4e-3, tip_outer_diameter=9e-3)
    source, target = (
        RobotModel(Robot("r", segments=(segment,), elements=Elements(around, along, radial))).mesh
        for around, along, radial in ((6, 8, 1), (8, 13, 2))
    )
    carried = carried_shape(field(source.straight), source, target, by_elements=False)
    expected = field(target.straight)
    expected[target.clamped] = 0.0
    assert np.abs(carried - expected).max() < 1e-9 * np.abs(expected).max()


def test_a_shape_is_carried_by_elements_where_no_equilibrium_is_found_from_that_by_sections(monkeypatch):
    segment = Segment("a", 0.1, 12e-3, 4e-3)
    source, target = (MeshedModel(Robot("r", segments=(segment,), elements=Elements(6, along, 1))) for along in (6, 9))
    load = mesh_loads.MeshLoad("horizontal", np.array([-9.81, 0.0, 0.0]), np.zeros(0))
    near = mesh_loads.shapes_under(source, [load])
    ways = []

    def carried(u, one, other, *, by_elements):
        ways.append(by_elements)
        shape = carried_shape(u, one, other, by_elements=by_elements)
        return shape if by_elements else -0.9 * other.nodes  # crushed

    monkeypatch.setattr(mesh_loads, "carried_shape", carried)
    found = mesh_loads.shapes_under(target, [load], near=near, steps=0)
    assert ways == [False, True] and found.tips == pytest.approx(near.tips, abs=2e-4)


def test_elements_are_well_shaped_where_the_file_gives_none():
    robot = Robot("thick", segments=(Segment("a", 0.15, 20e-3, 2e-3),))  # the coarsest mesh has a Jacobian ratio of 0.09
    assert mesh_quality(RobotModel(robot).mesh).jacobian_ratio >= 0.2


def test_a_mesh_of_wedges_is_refused_with_numbers_that_work():
    robot = Robot("tail", segments=(Segment("a", 0.15, 20e-3, 2e-3),), elements=Elements())
    with pytest.raises(MeshError, match=r"Jacobian ratio of 0.088.*\{around: 6, along: 10, radial: 2\} would do"):
        RobotModel(robot)
