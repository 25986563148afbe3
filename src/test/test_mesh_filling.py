"""Bodies from surfaces and STEP files, filled by the optional meshers; and what is said without them."""

import subprocess
import sys

import numpy as np
import pytest
from mesh_bodies import surface

from gravcomp.description import MeshBody, Robot
from gravcomp.mesh import MeshError, body_mesh
from gravcomp.mesh_files import Placement, gmsh_library, placed_body
from gravcomp.mesh_files.filling import shapes
from gravcomp.simulation import RobotModel

trimesh = pytest.importorskip("trimesh")


@pytest.fixture
def own_cache(monkeypatch, tmp_path):
    monkeypatch.setenv("GRAVCOMP_CACHE", str(tmp_path / "cache"))


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


def test_a_surface_with_needles_is_filled_by_the_second_mesher(tmp_path, meshers):
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


def test_nothing_is_printed_on_stdout(tmp_path, meshers, capfd):
    body_mesh(Robot("tube", body=MeshBody(stl(tmp_path, *surface()), element_size=4e-3)))
    assert capfd.readouterr().out == ""


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
