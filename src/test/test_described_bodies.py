"""The robots on the page about bodies: each is read, meshed and drawn, and its picture is there and small."""

from pathlib import Path

import numpy as np
import pytest

from gravcomp.cables.routing import route_cables
from gravcomp.mesh import tube_mesh
from gravcomp.mesh.quality import mesh_quality
from gravcomp.mesh.refusal import well_shaped
from gravcomp.mesh.tube import coarse_elements
from gravcomp.report.described_robots import robots_on
from gravcomp.view.backbone import rest_backbone
from gravcomp.view.options import PageOptions
from gravcomp.view.page import Page
from gravcomp.view.skin import cable_skin, half_width
from gravcomp.view.snapshot import Snapshot
from gravcomp.view.wall import lumen_skin, wall_skins

PAGE = Path(__file__).resolve().parents[1] / "doc" / "bodies.md"
ROBOTS = {picture.stem: robot for robot, picture in robots_on(PAGE)}


def test_every_robot_of_the_page_has_its_picture():
    text = PAGE.read_text(encoding="utf-8")
    assert len(ROBOTS) == text.count("```yaml\n") == text.count("](pictures/bodies/") >= 8
    for _, picture in robots_on(PAGE):
        assert 2_000 < picture.stat().st_size < 60_000


@pytest.mark.parametrize("name", ROBOTS)
def test_a_described_robot_is_meshed_and_its_cables_run_inside(name):
    robot = ROBOTS[name]
    elements = well_shaped(robot, coarse_elements(robot))
    mesh = tube_mesh(robot, around=elements.around, along=elements.along, radial=elements.radial)
    assert mesh_quality(mesh).jacobian_ratio >= 0.2
    assert len(route_cables(robot, mesh)) == len(robot.cables) > 1


@pytest.mark.parametrize("name", ROBOTS)
def test_the_drawn_surface_is_that_of_the_description(name):
    """Every vertex lies on the outline of its section, apart from the rim and the end face, and no part is left out."""
    robot = ROBOTS[name]
    rim = robot.length - 0.14 * half_width(robot)
    reached = set()
    for skin in wall_skins(robot):
        for station, (x, y) in zip(skin.station, skin.offset):
            s = station * robot.length
            piece = robot.piece_at(s)
            gauge = piece.visible.section(s)[0].gauge(x, y)
            disk = next((segment.disks for segment in robot.segments if segment.name == piece.segment), None)
            if s < rim and disk is None and min(abs(s - p.start) for p in robot.pieces) > 1e-9:
                assert gauge == pytest.approx(1.0, abs=1e-3)
            if gauge > 0.999:
                reached.add(round(20 * station))
    assert reached >= set(range(20))
    backbone = rest_backbone(robot)
    position, rotation = backbone.at(np.array([1.0]))
    end = np.concatenate([skin.on(backbone)[skin.station > 1 - 1e-9] for skin in wall_skins(robot)])
    assert (end - position) @ rotation[0, :, 2] == pytest.approx(0.0, abs=1e-7)


@pytest.mark.parametrize("name", ROBOTS)
def test_the_faces_of_walls_face_outward_and_those_of_lumens_inward(name):
    robot = ROBOTS[name]
    volume = sum(_enclosed(skin, robot.length) for skin in wall_skins(robot))
    assert volume > 0.0
    lumens = lumen_skin(robot)
    assert (lumens is None) == (not any(piece.lumens for piece in robot.pieces))
    if lumens is not None:
        assert _enclosed(lumens, robot.length) < 0.0


def test_cables_run_straight_between_disks():
    robot = ROBOTS["disks"]
    station = np.unique(cable_skin(robot, robot.cables[0]).station)
    assert station == pytest.approx(np.linspace(0.0, 1.0, 9))


@pytest.mark.parametrize("name", ["bottle", "disks", "hook"])
def test_the_live_page_shows_a_described_robot(name):
    robot = ROBOTS[name]
    page = Page(robot, PageOptions(port=8950))
    names = page._server.scene._handle_from_node_name
    page.show(Snapshot(time=0.0, backbone=rest_backbone(robot)))
    page.close()
    assert {"/robot/wall0", "/robot/rest0", "/robot/cable_c1"} <= set(names)
    assert ("/robot/lumen" in names) == any(piece.lumens for piece in robot.pieces)


def test_the_picture_is_drawn(tmp_path):
    pytest.importorskip("matplotlib")
    from gravcomp.report.body_picture import draw_body

    draw_body(ROBOTS["three_lumens"], str(tmp_path / "body.png"))
    assert 2_000 < (tmp_path / "body.png").stat().st_size < 60_000


def _enclosed(skin, length: float) -> float:
    """Twice the area that the faces' sides enclose, summed over the sections: positive where they face outward."""
    vertices = np.column_stack([skin.offset, skin.station * length])
    a, b, c = (vertices[skin.faces[:, i]] for i in range(3))
    # Flux of (x, y, 0) through the faces, which end faces do not add to.
    normal = np.cross(b - a, c - a) / 2
    return float(((a + b + c)[:, :2] / 3 * normal[:, :2]).sum())
