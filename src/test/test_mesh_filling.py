"""Bodies from surfaces and STEP files, filled by the optional meshers; and what is said without them."""

import os
import subprocess
import sys

import numpy as np
import pytest
from mesh_bodies import boxes, surface

from gravcomp.description import MeshBody, Robot
from gravcomp.mesh import MeshError, body_mesh
from gravcomp.mesh_files import Placement, coarse_filling, gmsh_library, placed_body
from gravcomp.mesh_files.filling import shapes
from gravcomp.mesh_files.repair_surface import enclosed_volume
from gravcomp.mesh_files.repair_volume import cell_volumes
from gravcomp.simulation import RobotModel

trimesh = pytest.importorskip("trimesh")


@pytest.fixture
def own_cache(monkeypatch, tmp_path):
    monkeypatch.setenv("GRAVCOMP_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(coarse_filling, "_refused", {})


@pytest.fixture
def meshers(own_cache):
    for name in ("gmsh", "wildmeshing"):
        pytest.importorskip(name, reason="the meshers are optional: ./gravcomp mesh install", exc_type=(ImportError, OSError))


def stl(folder, nodes, faces) -> str:
    trimesh.Trimesh(nodes, faces, process=False).export(folder / "body.stl")
    return str(folder / "body.stl")


def test_a_surface_is_filled_with_well_shaped_elements(tmp_path, meshers):
    nodes, faces = surface()
    robot = Robot("tube", body=MeshBody(stl(tmp_path, nodes, faces), element_size=3e-3))
    mesh = body_mesh(robot)
    assert mesh.kind == "tet10" and shapes(mesh.nodes, mesh.elements[:, :4]).min() > 0.05
    volume = RobotModel(robot, mesh).elements.weights.sum()
    assert volume == pytest.approx(1e-9 * trimesh.Trimesh(nodes, faces).volume, rel=0.05)
    assert len(mesh.clamped) > 8 and len(mesh.tip) > 8


def test_the_same_surface_is_filled_once(tmp_path, meshers, monkeypatch):
    robot = Robot("tube", body=MeshBody(stl(tmp_path, *surface()), element_size=3e-3))
    first = body_mesh(robot)
    monkeypatch.setattr("gravcomp.mesh_files.filling.by_gmsh", None)
    assert np.array_equal(body_mesh(robot).nodes, first.nodes)


def test_a_surface_with_needles_is_filled_with_well_shaped_elements(tmp_path, meshers):
    """A short edge in a long surface makes flat elements where every edge is kept."""
    nodes, faces = surface()
    near = np.argmin(np.linalg.norm(nodes - [4.0, 0.0, 40.0], axis=1))
    # A triangle at that node is split by a point 20 um from it.
    face = faces[(faces == near).any(axis=1)][0]
    others = face[face != near]
    point = nodes[near] + 1e-2 * (nodes[others].mean(axis=0) - nodes[near])
    new = len(nodes)
    split = [np.where(face == corner, new, face) for corner in face]
    kept = faces[~(faces == face).all(axis=1)]
    robot = Robot("tube", body=MeshBody(stl(tmp_path, np.vstack([nodes, point]), np.vstack([kept, split])), element_size=3e-3))
    mesh = body_mesh(robot)
    assert shapes(mesh.nodes, mesh.elements[:, :4]).min() > 0.05
    assert len(mesh.clamped) > 8


def touching() -> tuple[np.ndarray, np.ndarray]:
    """A bar of 10 x 10 x 100 mm, and a cut of 2 um from its tip to 40 mm above its base: its walls touch nearly."""
    filled = np.ones((3, 2, 5), dtype=bool)
    filled[1, 1, 2:] = False
    return boxes([-5.0, -1e-3, 1e-3, 5.0], [-5.0, 0.0, 5.0], [0.0, 20.0, 40.0, 60.0, 80.0, 100.0], filled)


def united() -> tuple[np.ndarray, np.ndarray]:
    """The bar with two ribs across and two pockets whose walls miss the bar's by 10 um, as in unions of solids."""
    filled = np.ones((2, 3, 7), dtype=bool)
    filled[:, 2] = False
    filled[:, 2, [1, 3]] = True
    filled[0, 1, [0, 4]] = False
    return boxes([-5.0, 0.0, 5.0], [-5.0, 5.0, 5.01, 6.0], [0.0, 20.0, 24.0, 40.0, 44.0, 60.0, 64.0, 100.0], filled)


@pytest.mark.parametrize("body", [touching, united])
def test_a_surface_that_gmsh_fills_badly_is_made_anew_once_for_all_sizes(tmp_path, meshers, monkeypatch, body, caplog):
    starts = []
    run = subprocess.run
    monkeypatch.setattr("subprocess.run", lambda *arguments, **options: starts.append(1) or run(*arguments, **options))
    nodes, faces = body()
    path = stl(tmp_path, nodes, faces)
    volume = 1e-9 * enclosed_volume(nodes, faces)
    with caplog.at_level("INFO"):
        meshes = [body_mesh(Robot("bar", body=MeshBody(path, element_size=size))) for size in (6e-3, 4e-3)]
    for mesh in meshes:
        corners = mesh.elements[:, :4]
        assert shapes(mesh.nodes, corners).min() > 0.1
        assert cell_volumes(mesh.nodes, corners, "tet4").sum() == pytest.approx(volume, rel=5e-3)
        assert len(mesh.clamped) > 8 and len(mesh.tip) > 8
    assert len(meshes[1].elements) > 1.2 * len(meshes[0].elements)
    assert len(starts) == 1 and caplog.text.count("fills it coarsely") == 1


def test_a_mesher_that_fails_is_not_started_again_and_what_was_tried_is_named(tmp_path, meshers, monkeypatch):
    starts = []
    failed = subprocess.CompletedProcess([], 1, "", "RuntimeError: no envelope")
    monkeypatch.setattr("subprocess.run", lambda *arguments, **options: starts.append(1) or failed)
    path = stl(tmp_path, *touching())
    told = r"Gmsh, \d+\.\d s: worst shape .*; \d+\.\d s: fTetWild cannot .* no envelope\)\. Use a smaller"
    for size in (6e-3, 4e-3):
        with pytest.raises(MeshError, match=told):
            body_mesh(Robot("bar", body=MeshBody(path, element_size=size)))
    assert len(starts) == 1


def test_a_step_file_is_read_in_its_unit(tmp_path, meshers):
    path = tmp_path / "cone.step"
    with gmsh_library.gmsh_session(str(path), "cannot write the file") as gmsh:
        gmsh.model.occ.addCone(30, 10, 5, 0, 70, 0, 5, 3)
        gmsh.model.occ.synchronize()
        gmsh.write(str(path))
    body = placed_body(path, Placement(axis="auto"))
    assert body.length == pytest.approx(0.07, rel=1e-6)
    assert any("the thicker end" in note for note in body.notes) and any("fixed by the format" in note for note in body.notes)


def test_a_process_that_has_filled_a_mesh_does_not_end_by_a_closed_pipe(meshers):
    fill = (
        "import socket; from gravcomp.mesh_files.gmsh_library import gmsh_session\n"
        "with gmsh_session('body.stl', 'fails'): pass\n"
        "ours, theirs = socket.socketpair(); theirs.close()\n"
        "try: ours.send(b'x')\n"
        "except BrokenPipeError: print('refused')"
    )
    done = subprocess.run([sys.executable, "-c", fill], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "refused\n")


def test_the_libraries_of_gmsh_print_nothing(tmp_path, meshers, capfd):
    body_mesh(Robot("tube", body=MeshBody(stl(tmp_path, *surface()), element_size=4e-3)))
    with gmsh_library.gmsh_session("body.stl", "fails"):
        for stream in (1, 2):
            os.write(stream, b"BFGS update error")
    os.write(2, b"after")
    assert tuple(capfd.readouterr()) == ("", "after")


@pytest.mark.parametrize("suffix", [".stl", ".step"])
def test_without_gmsh_the_line_that_installs_it_is_named(tmp_path, own_cache, monkeypatch, suffix):
    monkeypatch.setitem(sys.modules, "gmsh", None)
    path = stl(tmp_path, *surface())
    if suffix == ".step":
        path = str(tmp_path / "body.step")
        (tmp_path / "body.step").write_text("ISO-10303-21;", encoding="utf-8")
    with pytest.raises(MeshError, match=r"Gmsh, .*is not installed; run: \./gravcomp mesh install$"):
        body_mesh(Robot("tube", body=MeshBody(path, element_size=3e-3)))


def test_gmsh_is_installed_after_a_yes_at_a_terminal(monkeypatch):
    asked, installed = [], []

    def problem():
        return None if installed else ImportError("No module named 'gmsh'")

    monkeypatch.setattr(gmsh_library, "_problem", problem)
    monkeypatch.setattr(gmsh_library, "_imported", lambda: "gmsh")
    monkeypatch.setattr(gmsh_library, "install_gmsh", lambda: installed.append(True))
    monkeypatch.setattr(gmsh_library.sys, "stdin", type("Terminal", (), {"isatty": lambda self: True})())
    monkeypatch.setattr(gmsh_library.system_packages, "confirmed", lambda question: asked.append(question) or True)
    assert gmsh_library._provided("body.stl") == "gmsh"
    assert len(asked) == 1 and installed
