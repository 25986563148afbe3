"""Meshes that other projects publish: a finger, a trunk and a tentacle, neither at the origin nor along z."""

import numpy as np
import pytest

from gravcomp.description import Cable, Material, MeshBody, Robot
from gravcomp.experiments.measured import default_folder
from gravcomp.mesh import body_mesh
from gravcomp.mesh_files import Placement, placed_body
from gravcomp.mesh_files.filling import shapes
from gravcomp.mesh_files.repair_surface import enclosed_volume
from gravcomp.mesh_files.repair_volume import cell_volumes
from gravcomp.simulation import Simulator

FOLDER = default_folder() / "mesh"
pytestmark = pytest.mark.skipif(not FOLDER.is_dir(), reason=f"no meshes in {FOLDER} (GRAVCOMP_DATA names the folder above it)")


def placed(name: str):
    return placed_body(FOLDER / name, Placement(axis="auto"))


def test_the_finger_is_fixed_at_its_flat_end():
    body = placed("finger.vtk")
    assert body.length == pytest.approx(0.10336635, rel=1e-6)
    assert body.notes[1].startswith("axis: -x of the file")
    base = body.nodes[body.nodes[:, 2] < 1e-9]
    assert np.ptp(base, axis=0) == pytest.approx([5e-3, 15e-3, 0.0], abs=1e-8)


def test_the_trunk_is_where_its_file_has_it():
    found, given = placed("trunk.vtk"), placed_body(FOLDER / "trunk.vtk", Placement(length=0.195))
    assert found.nodes == pytest.approx(given.nodes, abs=1e-9)


def test_the_tentacle_has_a_bent_axis_that_runs_inside_it():
    body = placed("Tentacle.stl")
    points, _ = body.axis.frames(np.linspace(0.02, 0.98, 60) * body.length)
    a, b, c = (body.nodes[body.cells[:, i]][None] - points[:, None] for i in range(3))
    la, lb, lc = (np.linalg.norm(x, axis=2) for x in (a, b, c))
    triple = np.einsum("pki,pki->pk", a, np.cross(b, c))
    ab, bc, ca = (np.einsum("pki,pki->pk", x, y) for x, y in ((a, b), (b, c), (c, a)))
    # The solid angle of a closed surface is 4 pi from inside (Van Oosterom, Strackee 1983).
    angle = 2.0 * np.arctan2(triple, la * lb * lc + ab * lc + bc * la + ca * lb).sum(axis=1)
    inside = np.abs(angle / (4.0 * np.pi) - 1.0) < 1e-6
    assert inside.mean() > 0.9  # it has notches, which the smooth axis may touch
    assert body.axis.bent and 0.16 < body.length < 0.20


@pytest.mark.slow
def test_the_tentacle_is_filled_though_a_union_left_edges_of_6_um(monkeypatch, tmp_path):
    for name in ("gmsh", "wildmeshing"):
        pytest.importorskip(name, reason="the meshers are optional: ./gravcomp mesh install", exc_type=(ImportError, OSError))
    monkeypatch.setenv("GRAVCOMP_CACHE", str(tmp_path))
    body = MeshBody(str(FOLDER / "Tentacle.stl"), axis="auto", element_size=6e-3)
    mesh = body_mesh(Robot("body", body=body))
    surface = body.placed()
    volume = cell_volumes(mesh.nodes, mesh.elements[:, :4], "tet4").sum()
    assert volume == pytest.approx(enclosed_volume(surface.nodes, surface.cells), rel=3e-3)
    assert shapes(mesh.nodes, mesh.elements[:, :4]).min() > 0.08


def test_the_finger_hangs_from_its_base():
    material = Material(law="neo_hookean", youngs_modulus=0.6e6, density=1080.0)
    body = MeshBody(str(FOLDER / "finger.vtk"), axis="auto", element_size=20e-3, material=material)
    robot = Robot("body", body=body, cables=(Cable("c", via_points=((0.0, 0.0, 0.01), (0.0, 0.0, 0.05))),))
    simulator = Simulator(robot, reduced=False)
    rest = simulator.solve(np.zeros(3))
    assert rest.status == 0 and rest.tip_position == pytest.approx([0.0, 0.0, robot.length], abs=1e-9 * robot.length)
    hanging = simulator.solve(np.array([-1.0, 0.0, 0.0]))
    assert hanging.status == 0 and hanging.tip_position[0] < -0.05 * robot.length
