"""Bodies from surfaces that are divided into hexahedra along their axis, and those that cannot be."""

import dataclasses

import numpy as np
import pytest

from gravcomp.description import (
    Cable,
    Elements,
    Lumen,
    Material,
    MeshBody,
    RestShape,
    Robot,
    Section,
    Segment,
    Station,
    load_robot_file,
)
from gravcomp.full_model import size_choice
from gravcomp.full_model.chosen_elements import is_chosen, with_chosen_elements
from gravcomp.full_model.mesh_error import error_of_mesh
from gravcomp.full_model.mesh_loads import mesh_loads, shapes_under
from gravcomp.full_model.model import MeshedModel
from gravcomp.full_model.recovered_strain import MeshEstimate
from gravcomp.mesh import MeshError, body_mesh, tube_mesh
from gravcomp.mesh.division import divided_mesh, why_not_swept
from gravcomp.mesh.measured_outline import MeasuredOutline
from gravcomp.mesh.quality import mesh_quality
from gravcomp.mesh.swept_sections import swept_sections
from gravcomp.mesh_files.repair_volume import boundary_triangles

trimesh = pytest.importorskip("trimesh")

LENGTH = 0.08
TUBE = Segment("a", LENGTH, 9e-3, 3e-3, tip_outer_diameter=6e-3)


def stl(folder, *segments: Segment, around: int = 32, radial: int = 2) -> str:
    """The surface of segments in a file, in mm: facets between the corners of elements."""
    elements = Elements(around=around, along=12, radial=radial, grading=1.0)
    mesh = tube_mesh(Robot("body", segments=segments, elements=elements))
    path = folder / "body.stl"
    trimesh.Trimesh(1e3 * mesh.nodes, boundary_triangles(mesh.elements), process=False).export(path)
    return str(path)


def test_a_tube_from_its_surface_moves_as_the_one_from_its_section(tmp_path, monkeypatch):
    monkeypatch.setenv("GRAVCOMP_CACHE", str(tmp_path / "cache"))
    cables = load_robot_file("mesh_body").robot.cables
    described = Robot("tube", segments=(TUBE,), cables=cables)
    # Polygons of 48 sides so much larger that they are as stiff and as heavy as the circles.
    side = 2.0 * np.pi / 48
    larger = ((np.sin(side) / side) * (2.0 + np.cos(side)) / 3.0) ** -0.25
    facets = Segment("a", LENGTH, 9e-3 * larger, 3e-3 * larger, tip_outer_diameter=6e-3 * larger)
    surface = Robot("tube", body=MeshBody(stl(tmp_path, facets, around=48, radial=1)), cables=cables)
    assert not is_chosen(surface)
    chosen = with_chosen_elements(surface)
    assert is_chosen(surface)
    model = MeshedModel(chosen)
    assert model.mesh.kind == "hex20" and len(model.mesh.elements) < 100
    loads = mesh_loads(model)
    here = shapes_under(model, loads)
    there = shapes_under(MeshedModel(dataclasses.replace(described, elements=chosen.elements)), loads, near=here)
    assert np.linalg.norm(here.tips - [0.0, 0.0, LENGTH], axis=1).max() > 0.1 * LENGTH
    assert np.linalg.norm(here.tips - there.tips, axis=1).max() < 1e-3 * LENGTH
    assert error_of_mesh(chosen) < 1e-3


BODIES = {
    "rectangle": Segment("a", LENGTH, section=Section("rectangle", 12e-3, 6e-3, tip_width=9e-3)),
    "rectangle with a lumen": Segment("a", LENGTH, section=Section("rectangle", 12e-3, 8e-3), lumen_diameter=3e-3),
    "flat ellipse": Segment("a", LENGTH, section=Section("ellipse", 12e-3, 6e-3)),
    "cone": Segment("a", LENGTH, 9e-3, tip_outer_diameter=4e-3),
    "lumen off the axis": Segment("a", LENGTH, 9e-3, lumens=(Lumen(3e-3, x=1.5e-3),)),
    "bent at rest": Segment("a", LENGTH, 9e-3, 3e-3, rest=RestShape(bend_angle=1.2, bend_plane=0.3)),
}


@pytest.mark.parametrize("segment", BODIES.values(), ids=BODIES)
def test_hexahedra_fill_the_surface(tmp_path, segment):
    coarse = {"around": 16, "radial": 1} if segment.rest else {}
    robot = Robot("body", body=MeshBody(stl(tmp_path, segment, **coarse), axis="auto" if segment.rest else "given"))
    mesh = divided_mesh(robot, Elements(around=16, along=12, radial=2, grading=1.0, equal_stiffness=True))
    assert mesh_quality(mesh).jacobian_ratio > 0.15
    placed = robot.body.placed()
    volume = MeshedModel(robot, mesh).elements.weights.sum()
    assert volume == pytest.approx(trimesh.Trimesh(placed.nodes, placed.cells).volume, rel=2e-3)
    assert mesh.in_layers and len(mesh.clamped) == len(mesh.tip)
    if segment.section and segment.section.shape == "rectangle":
        corner = 1e-3 * np.array([6.0, 3.0 if segment.section.height < 7e-3 else 4.0, 0.0])
        assert np.linalg.norm(np.abs(mesh.nodes) - corner, axis=1).min() < 1e-6


def test_a_half_round_section_has_nodes_on_its_edges_and_none_in_the_middle_of_its_flat_side():
    turn = np.linspace(-np.pi / 2, np.pi / 2, 41)
    curve = MeasuredOutline(np.column_stack([np.cos(turn), np.sin(turn)]))
    assert np.degrees(curve.corners) == pytest.approx([-113.0, 113.0], abs=1.0)
    slots = curve.with_slots(np.unwrap(curve.four_slots()))
    nodes = slots.boundary(np.radians([45.0, 135.0, 225.0, 315.0]))
    assert sorted(np.round(nodes[:, 0], 2)) == pytest.approx([0.0, 0.0, 0.87, 0.87], abs=0.03)


def test_a_parameter_of_an_ellipse_is_its_eccentric_angle_and_facets_that_stand_out_are_as_stiff():
    turn = np.linspace(0.0, 2 * np.pi, 400, endpoint=False)
    curve = MeasuredOutline(np.column_stack([3.0 + 2.0 * np.cos(turn), np.sin(turn)]))
    angle = np.array([0.3, 1.2, 4.0])
    assert curve.boundary(angle) == pytest.approx(np.column_stack([3.0 + 2.0 * np.cos(angle), np.sin(angle)]), abs=1e-3)
    assert curve.stood_out(np.arange(12) * np.pi / 6).half_width == pytest.approx(2.0 * (1.0 + 1.6e-3), rel=1e-3)


def test_why_a_body_cannot_be_swept_is_said(tmp_path):
    two = Segment("a", LENGTH, 9e-3, lumens=(Lumen(2e-3, x=2e-3), Lumen(2e-3, x=-2e-3)))
    robot = Robot("body", body=MeshBody(stl(tmp_path, two, around=6, radial=1)))
    assert "1 outlines and 2 lumens; one and up to one are swept" in why_not_swept(robot)
    with pytest.raises(MeshError, match=r"cannot be divided into `elements` along its axis: .* Leave `elements` out"):
        body_mesh(dataclasses.replace(robot, elements=Elements()))
    thick, thin = Segment("a", LENGTH / 2, 9e-3, 3e-3), Segment("b", LENGTH / 2, 6e-3, 3e-3)
    stepped = Robot("body", body=MeshBody(stl(tmp_path, thick, thin, around=8, radial=1)))
    assert why_not_swept(stepped).startswith("its section changes in a step at 4")


BASE, TIP = 10e-3, 4e-3  # radii of a finger
TURN = np.linspace(0.0, np.pi / 2, 24)
DOME = np.column_stack([TIP * np.cos(TURN), LENGTH - TIP + TIP * np.sin(TURN)])


def of_revolution(folder, profile, around: int = 48) -> str:
    """The surface of a profile of radii and heights (n, 2) in m in a file, in mm: as stiff and heavy as with circles."""
    side = 2.0 * np.pi / around
    larger = ((np.sin(side) / side) * (2.0 + np.cos(side)) / 3.0) ** -0.25
    path = folder / "body.stl"
    trimesh.creation.revolve(1e3 * np.array(profile) * [larger, 1.0], sections=around).export(path)
    return str(path)


def test_a_rounded_tip_is_swept_with_its_mass_and_its_tip(tmp_path):
    profile, soft = [[0.0, 0.0], [BASE, 0.0], *DOME[:-1], [0.0, LENGTH]], Material(youngs_modulus=0.1e6)
    surface = Robot("finger", body=MeshBody(of_revolution(tmp_path, profile), material=soft))
    assert why_not_swept(surface) is None
    elements = Elements(around=8, along=16, radial=1, grading=1.0, equal_stiffness=True)
    model = MeshedModel(surface, divided_mesh(surface, elements))
    assert mesh_quality(model.mesh).jacobian_ratio > 0.2
    tip = model.mesh.nodes[model.mesh.tip]
    assert np.allclose(tip[:, 2], LENGTH) and 0.1 * TIP < np.ptp(tip[:, 0]) / 2 < 0.4 * TIP
    cone, dome = np.pi / 3 * (LENGTH - TIP) * (BASE**2 + BASE * TIP + TIP**2), 2.0 / 3.0 * np.pi * TIP**3
    assert model.mass == pytest.approx(soft.density * (cone + dome), rel=1e-3)
    # The same finger described: its dome by stations.
    radii = TIP * np.array([1.0, 0.95, 0.85, 0.7, 0.54, 0.41, 0.31, 0.23])
    heights = LENGTH - TIP + np.sqrt(TIP**2 - radii**2)
    stations = (Station(0.0, 2 * BASE), *(Station(float(z), float(2 * r)) for z, r in zip(heights, radii)))
    described = Robot("finger", segments=(Segment("a", LENGTH, stations=stations, material=soft),))
    there = MeshedModel(described, divided_mesh(described, dataclasses.replace(elements, along=18)))
    loads = mesh_loads(there)
    here, other = (shapes_under(one, loads).tips[0] for one in (model, there))
    assert abs(here[0]) > 0.1 * LENGTH
    assert np.linalg.norm(here - other) < 5e-4 * LENGTH


@pytest.mark.parametrize(
    ("profile", "layers"),
    [
        ([[0, 0], [5e-3, 0], [5e-3, LENGTH], [0, LENGTH]], 0),
        ([[0, 0], [9e-3, 0], [5e-3, LENGTH], [0, LENGTH]], 0),
        ([[0, 0], [BASE, 0], *DOME[:-1], [0, LENGTH]], 5),
        ([[2e-3, 0], [BASE, 0], *DOME[: -sum(DOME[:, 0] <= 2e-3)], [2e-3, LENGTH - 0.5e-3], [2e-3, 0]], 5),
    ],
    ids=["rod", "cone", "rounded", "rounded with a lumen"],
)
def test_a_tip_is_rounded_where_it_shrinks_more_than_a_taper(tmp_path, profile, layers):
    body = MeshBody(of_revolution(tmp_path, profile))
    sections = swept_sections(body)
    assert len(sections.marks) == layers and sections.marks == tuple(sorted(sections.marks))
    if layers:
        assert sections.marks[0] > sections.length - 2.0 * TIP
        areas = [sections.curves(s)[-1].half_width for s in (*sections.marks, sections.length)]
        assert (np.diff(areas) < 0.0).all()


def test_tetrahedra_get_smaller_until_their_estimated_error_is_small_enough(tmp_path, monkeypatch):
    monkeypatch.setenv("GRAVCOMP_CACHE", str(tmp_path / "cache"))
    two = Segment("a", LENGTH, 9e-3, lumens=(Lumen(2e-3, x=2e-3), Lumen(2e-3, x=-2e-3)))
    robot = Robot("body", body=MeshBody(stl(tmp_path, two, around=6, radial=1), element_size=4e-3))
    tried = []

    def estimated(size):
        tried.append(size)
        return None if size < smallest else MeshEstimate(2e-3 * (size / 4e-3) ** 2, "bent", 0.0, size)

    monkeypatch.setattr(size_choice, "MeshedModel", lambda robot: robot.body.element_size)
    monkeypatch.setattr(size_choice, "estimated_error", estimated)
    monkeypatch.setattr(size_choice, "too_long", lambda size: (2e-3 / size) ** 7)
    smallest = 0.0
    chosen = with_chosen_elements(robot)
    assert chosen.elements is None and is_chosen(robot) and chosen.body.element_size == tried[-1]
    assert tried[0] == 4e-3 and 2.2e-3 < tried[-1] < 2.6e-3  # an error of 0.08 %
    # Where the next size takes too long, the best one that is estimated is kept.
    smallest, coarse = 3.9e-3, dataclasses.replace(robot, cables=(Cable("c", 0.0, radius=3e-3, end=LENGTH),))
    assert with_chosen_elements(coarse).body.element_size == 4e-3 and tried[-1] < 3.9e-3
    # Without a size in the file the first one is as small as can be estimated.
    smallest = 0.0
    free = dataclasses.replace(robot, body=dataclasses.replace(robot.body, element_size=None))
    monkeypatch.setattr(size_choice, "first_size", lambda body: 1e-3)
    assert with_chosen_elements(free).body.element_size == tried[-1] == pytest.approx(2.1e-3)


def test_the_elements_of_a_file_are_replaced_on_request():
    shipped = load_robot_file("mesh_body").robot
    again = dataclasses.replace(shipped, body=dataclasses.replace(shipped.body, remesh=True))
    assert with_chosen_elements(shipped) is shipped and why_not_swept(again) is None
    mesh = divided_mesh(again, Elements(around=6, along=10, grading=1.0))
    assert len(mesh.elements) == 60 and len(body_mesh(shipped).elements) == 144
