"""Meshes: tubes of any diameters, bodies from files, what is refused, quality."""

import dataclasses

import numpy as np
import pytest
from mesh_bodies import TAPERED_TUBE

from gravcomp.description import Cap, Elements, Material, MeshBody, Robot, Segment, load_robot_file
from gravcomp.mesh import MeshError, body_mesh, section_division, tube_mesh
from gravcomp.mesh.elements import KINDS, jacobians, reference_nodes, shape_gradients, shape_values
from gravcomp.mesh.embedding import embed
from gravcomp.mesh.quality import mesh_quality
from gravcomp.mesh.refinement import refined
from gravcomp.mesh.sections import section_functionals
from gravcomp.simulation import RobotModel, Simulator


def test_stepped_tubes_and_caps_share_their_nodes():
    robot = Robot(
        "stepped",
        segments=(
            Segment("wide", 0.03, 9e-3, 3e-3, cap=Cap(2e-3, Material(youngs_modulus=1e9))),
            Segment("narrow", 0.03, 7e-3, 4e-3),
        ),
        elements=Elements(around=12, along=8),
    )
    model = RobotModel(robot)  # raises for a part that is not connected to the base
    assert robot.length == pytest.approx(0.062)
    volume = np.pi / 4 * ((9e-3**2 - 3e-3**2) * 0.032 + (7e-3**2 - 4e-3**2) * 0.03)
    assert model.elements.weights.sum() == pytest.approx(volume, rel=2e-3)  # facets of 30 deg


def test_points_are_found_where_they_are():
    mesh = tube_mesh(load_robot_file("article").robot)
    angle = np.linspace(0.0, 6.0, 13)
    points = np.column_stack([3e-3 * np.cos(angle), 3e-3 * np.sin(angle), np.linspace(0.0, 0.1, 13)])
    found = embed(mesh, points)
    assert np.einsum("pa,pai->pi", found.weights, mesh.nodes[found.nodes]) == pytest.approx(points, abs=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_the_jacobians_of_elements_are_derivatives_of_their_places(kind):
    chance = np.random.default_rng(3)
    nodes = reference_nodes(kind) + 0.1 * chance.standard_normal((4, *reference_nodes(kind).shape))
    points, step = chance.uniform(0.1, 0.3, (5, 3)), 1e-6
    found = jacobians(nodes, shape_gradients(kind, points))
    for j, shift in enumerate(step * np.eye(3)):
        ahead, behind = (shape_values(kind, points + sign * shift) for sign in (1, -1))
        assert found[..., j] == pytest.approx(((ahead - behind) / (2 * step)) @ nodes, abs=1e-8)


def test_sections_see_where_the_axis_goes():
    mesh = tube_mesh(load_robot_file("article").robot)
    gradient = np.array([[1.1, 0.1, 0.3], [0.0, 0.9, -0.2], [0.2, 0.0, 1.0]])
    rows = (section_functionals(mesh, np.array([0.0, 0.037, 0.1])) @ (mesh.nodes @ gradient.T)).reshape(3, 3, 3)
    assert rows[:, 0] == pytest.approx(np.outer([0.0, 0.037, 0.1], gradient[:, 2]), abs=1e-12)
    assert rows[:, 1:] == pytest.approx(np.broadcast_to(gradient[:, :2].T, (3, 2, 3)), abs=1e-9)


def test_the_sections_of_a_mesh_that_is_made_again_are_the_same_and_those_of_another_are_not():
    robot = load_robot_file("article").robot
    heights = np.array([0.0, 0.037, 0.1])
    first = section_functionals(tube_mesh(robot), heights)
    kept = first.copy()
    first[:] = 0.0  # what is returned belongs to the caller
    assert section_functionals(tube_mesh(robot), heights) == pytest.approx(kept, abs=0.0)
    assert section_functionals(tube_mesh(robot), heights[::-1])[:3] == pytest.approx(kept[6:], abs=0.0)
    finer = tube_mesh(dataclasses.replace(robot, elements=Elements(around=8, along=10)))
    assert section_functionals(finer, heights).shape == (9, len(finer.nodes))


def test_meshes_that_differ_along_the_robot_have_one_division_of_the_section(monkeypatch):
    robot = load_robot_file("article").robot
    pieces, length = robot.pieces, robot.length
    one = section_division.divided_sections(pieces, 6, 1)
    monkeypatch.setattr(section_division, "section_grid", None)  # a call fails
    monkeypatch.setattr(section_division, "lumen_grid", None)
    assert section_division.divided_sections(pieces, 6, 1) is one
    meshes = [tube_mesh(robot, around=6, along=along, radial=1) for along in (12, 14)]
    assert [mesh.length for mesh in meshes] == [length, length] and len(meshes[0].nodes) < len(meshes[1].nodes)


def test_too_few_layers_are_named():
    robot = dataclasses.replace(load_robot_file("three_segment").robot, elements=Elements(along=2))
    with pytest.raises(MeshError, match=r"elements\.along is 2; the robot has 3 tubes"):
        tube_mesh(robot)


def test_the_shipped_body_has_an_equilibrium():
    shape = Simulator(load_robot_file("mesh_body").robot, reduced=False).solve([-9.81, 0.0, 0.0])
    assert shape.status == 0 and shape.tip_position[0] < -5e-3


def test_the_shipped_body_is_the_tube_that_its_file_describes():
    shape = Segment("a", 0.08, 9e-3, 3e-3, tip_outer_diameter=6e-3)
    tube = tube_mesh(Robot("tube", segments=(shape,), elements=Elements(around=6, along=24, radial=1, grading=1.0)))
    shipped = body_mesh(load_robot_file("mesh_body").robot)
    assert shipped.nodes == pytest.approx(tube.nodes, abs=1e-9) and np.array_equal(shipped.elements, tube.elements)


def body(file: str, **changes) -> Robot:
    return Robot("body", body=dataclasses.replace(MeshBody(file, 0.08), **changes))


def in_tetrahedra() -> Robot:
    """The shipped body, of coarse tetrahedra."""
    robot = load_robot_file("mesh_body").robot
    return dataclasses.replace(robot, body=dataclasses.replace(robot.body, file=str(TAPERED_TUBE)))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"file_unit": 1.0}, ["length_mm says 80 along z", "write file_unit_mm: 1"]),
        ({"length": 0.05}, ["length_mm says 50"]),
        ({"file": "missing.vtk"}, ["does not exist"]),
        ({"file": __file__}, ["allowed are .stl"]),
    ],
)
def test_a_body_that_does_not_fit_its_description_is_refused(changes, words):
    with pytest.raises(MeshError) as error:
        body_mesh(body(**{"file": str(TAPERED_TUBE)} | changes))
    for word in words:
        assert word in str(error.value)


def test_a_body_lying_on_its_side_is_refused(tmp_path):
    import meshio

    content = meshio.read(str(TAPERED_TUBE))
    meshio.write(tmp_path / "side.vtk", meshio.Mesh(content.points[:, [2, 0, 1]], content.cells))
    with pytest.raises(MeshError, match="its axis is not z"):
        body_mesh(body(str(tmp_path / "side.vtk")))


def test_linear_tetrahedra_become_quadratic_with_a_warning(tmp_path, caplog):
    import meshio

    content = meshio.read(str(TAPERED_TUBE))
    linear = meshio.Mesh(content.points, [("tetra", content.cells[0].data[:, :4])])
    meshio.write(tmp_path / "linear.vtk", linear)
    assert body_mesh(body(str(tmp_path / "linear.vtk"))).kind == "tet10"
    assert "lock in bending" in caplog.text


def test_quality_sees_a_distorted_element():
    mesh = tube_mesh(load_robot_file("article").robot)
    assert mesh_quality(mesh).advice == ()
    nodes = mesh.nodes.copy()
    nodes[mesh.elements[0, 6]] = nodes[mesh.elements[0, 0]] + 0.3 * (nodes[mesh.elements[0, 6]] - nodes[mesh.elements[0, 0]])
    bad = mesh_quality(dataclasses.replace(mesh, nodes=nodes))
    assert bad.jacobian_ratio < 0.1 and "distorted" in bad.advice[0]


def test_long_elements_are_no_flaw():
    """Whether they are too long, the estimated error of the tip says, not their shape."""
    rod = Robot("rod", segments=(Segment("a", 0.1, 1.5e-3, 0.7e-3),), elements=Elements(around=6, along=4))
    quality = mesh_quality(tube_mesh(rod))
    assert quality.aspect_ratio > 50.0 and quality.advice == ()


@pytest.mark.parametrize("kind", ["tet10", "hex20"])
def test_divided_elements_have_the_same_surface_and_contain_the_same_shapes(kind):
    """A rounded element, divided: the same volume, and a quadratic displacement of the old nodes is that of the new ones."""
    body = in_tetrahedra() if kind == "tet10" else load_robot_file("mesh_body").robot
    mesh = body_mesh(body)
    assert mesh.kind == kind
    radius = np.hypot(mesh.nodes[:, 0], mesh.nodes[:, 1])
    mesh = dataclasses.replace(mesh, nodes=mesh.nodes * (1.0 + 5.0 * radius[:, None] * [1.0, 1.0, 0.0]))  # curved sides
    finer = refined(mesh)
    assert len(finer.elements) == 8 * len(mesh.elements)
    assert len(np.unique(finer.nodes.round(12), axis=0)) == len(finer.nodes)
    coarse_model, fine_model = (RobotModel(body, one) for one in (mesh, finer))
    assert fine_model.body_weight.sum() == pytest.approx(coarse_model.body_weight.sum(), rel=1e-12)
    some = finer.nodes[len(mesh.nodes) :: 29]
    place = embed(mesh, some)
    assert np.einsum("pc,pci->pi", place.weights, mesh.nodes[place.nodes]) == pytest.approx(some, abs=1e-9 * mesh.length)
    assert (place.outside < 1e-9).all()
