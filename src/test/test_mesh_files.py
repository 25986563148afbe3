"""Bodies as they come from other programmes: formats, units, places, and what is repaired or refused."""

import numpy as np
import pytest
from mesh_bodies import bent, cone, rounded, surface

from gravcomp.config import ConfigError
from gravcomp.description import Cable, MeshBody, Robot, Transform, load_robot_file
from gravcomp.mesh import MeshError, body_mesh
from gravcomp.mesh_files import Placement, placed_body
from gravcomp.simulation import RobotModel

meshio = pytest.importorskip("meshio")
trimesh = pytest.importorskip("trimesh")

TURNED = trimesh.transformations.euler_matrix(0.3, 1.1, -0.4)[:3, :3]


def write(path, nodes, cells) -> str:
    """Write triangles or tetrahedra in the format of the suffix."""
    if path.suffix in (".stl", ".obj", ".ply"):
        trimesh.Trimesh(nodes, cells, process=False).export(path)
    else:
        kind = {3: "triangle", 4: "tetra"}[cells.shape[1]]
        meshio.write(path, meshio.Mesh(nodes, [(kind, cells)]), **({"file_format": "gmsh22"} if path.suffix == ".msh" else {}))
    return str(path)


def placed(path, **options):
    return placed_body(path, Placement(**options))


@pytest.mark.parametrize("suffix", [".vtk", ".vtu", ".msh", ".inp"])
def test_volumes_are_read_in_every_format(tmp_path, suffix):
    body = placed(write(tmp_path / f"cone{suffix}", *cone()))
    assert body.kind == "tet4" and len(body.cells) == len(cone()[1]) and body.length == pytest.approx(0.08)


@pytest.mark.parametrize("suffix", [".stl", ".obj", ".ply", ".vtk"])
def test_surfaces_are_read_in_every_format(tmp_path, suffix):
    body = placed(write(tmp_path / f"cone{suffix}", *surface()))
    assert body.kind == "tri3" and len(body.nodes) == len(surface()[0]) and body.length == pytest.approx(0.08)


def test_linear_hexahedra_become_quadratic(tmp_path):
    grid = np.stack(np.meshgrid(*[np.arange(2)] * 2, np.arange(4), indexing="ij"), axis=-1).reshape(-1, 3) * [5.0, 5.0, 10.0]
    corner = np.array([0, 8, 12, 4])
    cells = np.array([[*(corner + k), *(corner + k + 1)] for k in range(3)])
    meshio.write(tmp_path / "bar.vtk", meshio.Mesh(grid, [("hexahedron", cells[:, [4, 5, 6, 7, 0, 1, 2, 3]])]))
    mesh = body_mesh(Robot("bar", body=MeshBody(str(tmp_path / "bar.vtk"), axis="auto")))
    assert mesh.kind == "hex20" and len(mesh.nodes) == 16 + 4 * 3 + 4 * 4


@pytest.mark.parametrize("solid", [True, False])
def test_the_axis_is_found_wherever_the_body_lies(tmp_path, solid):
    nodes, cells = cone() if solid else surface()
    body = placed(
        write(tmp_path / ("cone.vtk" if solid else "cone.stl"), nodes @ TURNED.T + [40.0, -300.0, 7.0], cells), axis="auto"
    )
    radius = np.hypot(body.nodes[:, 0], body.nodes[:, 1])
    assert body.length == pytest.approx(0.08, rel=1e-5) and not body.axis.bent
    assert radius[body.nodes[:, 2] < 1e-9].max() == pytest.approx(4.5e-3, rel=1e-3)  # the thicker end is the base
    assert radius[body.nodes[:, 2] > body.length - 1e-9].max() == pytest.approx(3e-3, rel=1e-3)
    assert any("the thicker end" in note for note in body.notes)


def test_base_and_tip_can_be_exchanged(tmp_path):
    path = write(tmp_path / "cone.vtk", *cone())
    radius = [
        np.hypot(*body.nodes[body.nodes[:, 2] < 1e-9, :2].T).max()
        for body in (placed(path, axis="auto"), placed(path, axis="auto_reversed"))
    ]
    assert radius == pytest.approx([4.5e-3, 3e-3], rel=1e-3)


def test_the_flat_end_is_the_base(tmp_path):
    rounding = [[5.0 * np.cos(a), 30.0 + 5.0 * np.sin(a)] for a in np.linspace(0.0, np.pi / 2, 8)[:-1]]
    bullet = trimesh.creation.revolve([[0.0, 0.0], [5.0, 0.0], [5.0, 15.0], *rounding, [0.0, 35.0]], sections=24)
    upside_down = bullet.vertices * [1.0, 1.0, -1.0], bullet.faces[:, ::-1]
    body = placed(write(tmp_path / "bullet.stl", *upside_down), axis="auto")
    assert any("the flatter face" in note for note in body.notes)
    flat = body.nodes[body.nodes[:, 2] < 1e-9]
    assert np.hypot(flat[:, 0], flat[:, 1]).max() == pytest.approx(5e-3, rel=1e-3)


def test_a_body_that_is_bent_at_rest_has_a_bent_axis(tmp_path):
    nodes, faces = surface()
    body = placed(write(tmp_path / "arc.stl", bent(nodes, np.deg2rad(50.0)), faces), axis="auto")
    tangent = body.axis.frames(np.array([body.length]))[1][0, :, 2]
    assert body.length == pytest.approx(0.08, rel=5e-3)
    assert np.degrees(np.arccos(tangent[2])) == pytest.approx(50.0, abs=2.0)


def test_the_transform_scales_turns_and_moves_in_this_order(tmp_path):
    nodes, cells = cone()
    lying = nodes[:, [2, 0, 1]] / 2.0 - [0.0, 3.0, 0.0]  # along x, half as large, aside
    body = placed(write(tmp_path / "cone.vtk", lying, cells), scale=2.0, rotate=(0.0, -np.pi / 2, 0.0), move=(0.0, 6e-3, 0.0))
    # The file's -z is x of the robot, its y is y, its x is z.
    assert body.nodes == pytest.approx(1e-3 * nodes[:, [1, 0, 2]] * [-1.0, 1.0, 1.0], abs=1e-7)


def test_the_unit_is_found_from_size_or_length(tmp_path):
    nodes, cells = cone()
    millimetres, metres = write(tmp_path / "mm.vtk", nodes, cells), write(tmp_path / "m.vtk", nodes / 1e3, cells)
    assert placed(millimetres).length == pytest.approx(0.08) == placed(metres).length
    assert any("unit m, guessed from the size" in note for note in placed(metres).notes)
    assert any("found from length_mm" in note for note in placed(metres, length=0.08).notes)


def inches(folder) -> str:
    nodes, cells = cone()
    return write(folder / "inches.vtk", nodes / 25.4, cells)


def test_inches_are_named_as_a_possibility(tmp_path):
    with pytest.raises(MeshError, match=r"it fits a file in inch: write file_unit_mm: 25\.4"):
        placed(inches(tmp_path), length=0.08)
    with pytest.raises(MeshError, match=r"inch \(80 mm\): file_unit_mm: 25\.4"):
        placed(inches(tmp_path))
    assert placed(inches(tmp_path), unit=25.4e-3).length == pytest.approx(0.08)


@pytest.mark.parametrize(
    ("in_mm", "file_unit", "end", "message"),
    [
        (0.1, None, 0.070, r"looks like cm: with body\.file_unit_mm: 10 the body is 80 mm long"),
        (1 / 25.4, 1e-3, 0.080, r"looks like inch: with body\.file_unit_mm: 25\.4 the body is 80 mm long"),
        (
            1e-3,
            1e-3,
            0.080,
            r"0\.08 mm long with the unit mm, as declared; allowed: 1 to .*m \(80 mm\): file_unit_mm: 1000",
        ),
        (0.1, None, 0.008, r"it must lie inside \(the file: unit mm, guessed.*: 8 mm long\)"),
    ],
)
def test_a_unit_that_does_not_suit_the_cables_is_named(tmp_path, in_mm, file_unit, end, message):
    nodes, cells = cone()
    body = MeshBody(write(tmp_path / "cone.vtk", in_mm * nodes, cells), file_unit=file_unit)
    with pytest.raises(ValueError, match=message):
        RobotModel(Robot("cone", body=body, cables=(Cable("c", angle=0.0, radius=2.2e-3, end=end),)))


def test_a_length_that_is_a_little_off_is_put_right(tmp_path):
    with pytest.raises(MeshError, match="write length_mm: 80, or leave it out"):
        placed(write(tmp_path / "cone.vtk", *cone()), length=0.0805)


def test_flaws_of_volumes_are_mended_and_said(tmp_path, caplog):
    nodes, cells = cone()
    twice = np.vstack([nodes, nodes[:5]])  # repeated nodes, in use
    flawed = cells.copy()
    flawed[flawed == 3] = len(nodes) + 3
    flawed[::7] = flawed[::7][:, [0, 2, 1, 3]]  # inverted
    flawed = np.vstack([flawed, flawed[4:6], [[0, 1, 2, 2]]])  # repeated, collapsed
    body = placed(write(tmp_path / "flawed.vtk", twice, flawed))
    assert len(body.cells) == len(cells)
    corners = body.nodes[body.cells]
    assert (np.linalg.det(corners[:, 1:] - corners[:, :1]) > 0).all()
    for words in ("repeated elements", "collapsed elements", "inverted elements", "linear tetrahedra lock"):
        assert any(words in note for note in body.notes) and words in caplog.text, words


def test_repeated_nodes_are_merged(tmp_path):
    nodes, cells = cone()
    body = placed(write(tmp_path / "loose.vtk", nodes[cells].reshape(-1, 3), np.arange(cells.size).reshape(-1, 4)))
    assert len(body.nodes) == len(nodes) and any("repeated nodes were merged" in note for note in body.notes)


def test_elements_that_do_not_fit_together_are_named(tmp_path):
    """One element has a node in the middle of a side, which its neighbour lacks."""
    nodes, cells = cone()
    sides = np.sort(cells[:, 1:], axis=1)
    inner = next(k for k in range(len(cells)) if (np.isin(cells, sides[k]).sum(axis=1) >= 3).sum() == 2)
    a, b, c, d = cells[inner]
    middle = len(nodes)
    split = [(a, b, c, middle), (a, c, d, middle), (a, d, b, middle)]
    body = placed(
        write(
            tmp_path / "hanging.vtk",
            np.vstack([nodes, nodes[[b, c, d]].mean(axis=0)]),
            np.vstack([np.delete(cells, inner, 0), split]),
        )
    )
    assert any("4 faces of elements touch a neighbour" in note for note in body.notes)
    assert not any("cracks" in note for note in placed(write(tmp_path / "whole.vtk", nodes, cells)).notes)


def test_flaws_of_surfaces_are_mended_and_said(tmp_path):
    nodes, faces = surface()
    flawed = np.delete(faces, 20, axis=0)  # a small hole
    flawed[::5] = flawed[::5, ::-1]
    body = placed(write(tmp_path / "flawed.ply", nodes, np.vstack([flawed, flawed[7]])))
    for words in ("repeated triangles", "turned over", "was filled"):
        assert any(words in note for note in body.notes), words
    assert trimesh.Trimesh(body.nodes, body.cells).volume == pytest.approx(1e-9 * trimesh.Trimesh(nodes, faces).volume, rel=0.01)


def refused(path, words, **options):
    with pytest.raises(MeshError) as error:
        placed(path, **options)
    assert words in str(error.value) and str(path) in str(error.value)
    return str(error.value)


def test_a_large_hole_is_refused_with_a_picture_of_it(tmp_path):
    pytest.importorskip("matplotlib")
    nodes, faces = surface()
    middle = nodes[faces].mean(axis=1)
    side = (middle[:, 2] > 10) & (middle[:, 2] < 50) & (middle[:, 0] > 0) & (np.hypot(*middle[:, :2].T) > 2)
    text = refused(write(tmp_path / "open.stl", nodes, faces[~side]), "the surface is not closed: 1 holes")
    picture = tmp_path / "open_flaws.png"
    assert text.endswith(f"Picture: {picture}") and picture.read_bytes().startswith(b"\x89PNG")


def test_the_open_ends_of_a_tube_are_not_guessed(tmp_path):
    tube = trimesh.creation.annulus(r_min=1.5, r_max=4.5, height=60.0)
    sides = np.abs(tube.face_normals[:, 2]) < 0.5
    refused(write(tmp_path / "tube.stl", tube.vertices, tube.faces[sides]), "separate bodies")
    ends = sides | (tube.triangles_center[:, 2] < 0)  # one end is closed
    refused(write(tmp_path / "end.stl", tube.vertices, tube.faces[ends]), "alone in their plane")


def test_a_body_without_volume_is_refused(tmp_path):
    nodes, cells = cone()
    refused(write(tmp_path / "flat.vtk", nodes * [1.0, 0.0, 1.0], cells), "has no volume")
    square = np.array([[0.0, 0, 0], [5, 0, 0], [5, 0, 60], [0, 0, 60]])
    both_sides = np.array([[0, 1, 2], [0, 2, 3], [2, 1, 0], [3, 2, 0]])
    refused(write(tmp_path / "flat.stl", square, both_sides), "has no volume")


def test_two_bodies_are_refused(tmp_path):
    for suffix, (nodes, cells) in ((".vtk", cone()), (".stl", surface())):
        both = np.vstack([nodes, nodes + np.array([30.0, 0.0, 0.0])]), np.vstack([cells, cells + len(nodes)])
        refused(write(tmp_path / f"two{suffix}", *both), "2 separate bodies")


@pytest.mark.parametrize(
    ("name", "head"),
    [
        ("huge.vtk", "# vtk DataFile Version 3.0\nx\nASCII\nDATASET UNSTRUCTURED_GRID\nCELLS 10000000 50000000\n"),
        ("huge.vtu", '<VTKFile><UnstructuredGrid><Piece NumberOfPoints="4" NumberOfCells="10000000">'),
        ("huge.msh", "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Elements\n10000000\n1 4 2 0 0 1 2 3 4\n"),
        ("four.msh", "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Elements\n1 10000000 1 10000000\n"),
    ],
)  # fmt: skip
def test_ten_million_elements_are_refused_before_they_are_read(tmp_path, name, head):
    path = tmp_path / name
    path.write_text(head, encoding="utf-8")
    refused(path, "10000000 cells; body.elements_max allows 20000")


def test_the_limit_of_elements_is_declared(tmp_path):
    path = write(tmp_path / "cone.inp", *cone())
    refused(path, f"has {len(cone()[1])} elements; body.elements_max allows 100", elements_max=100)
    with pytest.raises(MeshError, match="use element_size_mm"):
        body_mesh(Robot("fine", body=MeshBody(write(tmp_path / "cone.stl", *surface()), element_size=0.1e-3)))


def test_too_many_triangles_are_refused_before_they_are_read(tmp_path):
    path = tmp_path / "huge.stl"
    with path.open("wb") as file:
        file.write(bytes(80) + (10_000_000).to_bytes(4, "little"))
        file.truncate(84 + 50 * 10_000_000)  # a sparse file
    refused(path, "has 10000000 triangles; allowed are 1000000")


def test_coordinates_that_are_no_numbers_are_refused(tmp_path):
    for suffix, (nodes, cells) in ((".vtk", cone()), (".stl", surface())):
        nodes[7, 1] = np.nan
        refused(write(tmp_path / f"nan{suffix}", nodes, cells), "not finite numbers")


def test_a_surface_that_passes_through_itself_is_refused(tmp_path):
    nodes, faces = surface()
    through = nodes.copy()
    inner = np.hypot(nodes[:, 0], nodes[:, 1]) < 1.6
    through[inner & (nodes[:, 2] > 30) & (nodes[:, 2] < 50), 0] += 4.0  # the lumen leaves the body
    text = refused(write(tmp_path / "through.stl", through, faces), "passes through itself")
    assert "_flaws.png" in text


def test_folded_elements_are_refused(tmp_path):
    nodes, cells = cone()
    inner = np.flatnonzero((nodes[:, 2] > 25) & (nodes[:, 2] < 35))
    nodes[inner, 2] += 25.0
    refused(write(tmp_path / "folded.vtk", nodes, cells), "the mesh is folded")


def test_a_ball_has_no_axis(tmp_path):
    ball = trimesh.creation.icosphere(subdivisions=2, radius=20.0)
    refused(write(tmp_path / "ball.stl", ball.vertices, ball.faces), "finds no axis", axis="auto")


def test_a_body_on_its_side_is_named_as_such(tmp_path):
    nodes, cells = cone()
    refused(write(tmp_path / "side.vtk", nodes[:, [2, 0, 1]], cells), "its axis is not z but nearer to x")


def test_a_body_off_the_base_is_refused(tmp_path):
    nodes, cells = cone()
    refused(write(tmp_path / "high.vtk", nodes + np.array([0, 0, 5.0]), cells), "the base must lie at z = 0")


@pytest.mark.parametrize(
    ("name", "words"), [("a.3ds", "'.3ds' is not read"), ("a.vtk", "not what '.vtk' stands for"), ("a.stl", "a.stl")]
)
def test_what_is_no_mesh_is_refused(tmp_path, name, words):
    (tmp_path / name).write_text("no mesh", encoding="utf-8")
    refused(tmp_path / name, words)
    refused(tmp_path / "missing.vtk", "does not exist")


def robot_file(folder, body: str) -> str:
    write(folder / "cone.vtk", *cone())
    (folder / "robot.yaml").write_text(
        f"robot:\n  name: cone\n  body: {{file: cone.vtk, {body}}}\n"
        "  cables: [{name: a, angle_deg: 0.0, radius_mm: 2.2, end_mm: 80.0}]\n",
        encoding="utf-8",
    )
    return str(folder / "robot.yaml")


def test_a_robot_file_needs_neither_unit_nor_length(tmp_path):
    robot = load_robot_file(robot_file(tmp_path, "axis: auto, element_size_mm: 10")).robot
    assert robot.length == pytest.approx(0.08)
    assert RobotModel(robot).tendons.rest_length == pytest.approx([0.08], rel=1e-6)


def test_an_error_of_the_body_names_the_robot_file(tmp_path):
    path = robot_file(tmp_path, "axis: auto")
    nodes, cells = cone()
    write(tmp_path / "cone.vtk", nodes * [10.0, 10.0, 1.0], cells)
    with pytest.raises(ConfigError, match=r"robot\.yaml: robot: .*cone\.vtk: axis: auto finds no axis"):
        load_robot_file(path)


@pytest.mark.parametrize("shape", ["straight", "rounded", "bent", "bent and rounded"])
def test_a_body_at_rest_is_where_it_was_described(tmp_path, shape):
    """Backbone and tip of the undeformed body lie on its axis, also where it is bent or its tip is rounded."""
    nodes, cells = cone()
    nodes = rounded(nodes) if "rounded" in shape else nodes
    nodes = bent(nodes, np.deg2rad(60.0)) if "bent" in shape else nodes
    path = write(tmp_path / "cone.vtk", nodes, cells)
    model = RobotModel(Robot("cone", body=MeshBody(path, axis="auto", element_size=0.01)))
    sections, mesh = model.effectors.sections(model.mesh.nodes), model.mesh
    assert mesh.axis.bent == ("bent" in shape)
    position, rotation = mesh.axis.frames(np.append(np.linspace(0.0, 1.0, 11), 1.0) * mesh.length)
    assert sections[:, 0] == pytest.approx(position, abs=1e-9 * mesh.length)
    assert sections[:, 1:] == pytest.approx(rotation[:, :, :2].transpose(0, 2, 1), abs=1e-7)


def test_a_cable_keeps_inside_a_transformed_body(tmp_path):
    nodes, cells = cone()
    body = MeshBody(
        write(tmp_path / "cone.vtk", nodes[:, [2, 0, 1]], cells),
        transform=Transform(rotate=(0.0, -np.pi / 2, 0.0)),
        element_size=0.02,
    )
    model = RobotModel(Robot("cone", body=body, cables=(Cable("a", angle=0.0, radius=2.2e-3, end=0.08),)))
    assert model.tendons.rest_length == pytest.approx([0.08], rel=1e-6)
