"""The page's scene, forces and handles: what is drawn where, what a browser's messages do, what is refused."""

import asyncio
import contextlib
import dataclasses
import math
import types
from pathlib import Path

import msgspec
import numpy as np
import pytest
import viser

from gravcomp.description import load_robot_file
from gravcomp.operator.picture import Camera
from gravcomp.scene import BoxWall, PlaneWall, SceneSection, SphereWall, TubeWall
from gravcomp.scene.distance import gap_to
from gravcomp.scene.scene import Scene
from gravcomp.view.backbone import arc_backbone
from gravcomp.view.forces import ForceScale
from gravcomp.view.obstacle_shapes import obstacle_shapes
from gravcomp.view.options import PageOptions
from gravcomp.view.page import Page
from gravcomp.view.requests import PlaceWall, Push, SetTarget, TiltBase
from gravcomp.view.scale import SCALE
from gravcomp.view.snapshot import Snapshot
from gravcomp.view.status import touches_html
from gravcomp.view.tip_camera import HALF_VIEW, TipCamera, place
from gravcomp.view.touches import Touch, force_text, model_touches, resultants
from gravcomp.virtual.placed_wall import parse_wall

LENGTH = 0.1
SECTION = SceneSection(
    planes=(PlaneWall(normal=(1, 2, 0.5), point=(-0.02, 0, 0)), PlaneWall(point=(0, 0, -0.03), frame="world")),
    spheres=(SphereWall(centre=(0.01, 0.02, 0.03), radius=0.01), SphereWall(radius=0.2, side="inside")),
    boxes=(
        BoxWall(centre=(0.02, 0, 0.05), size=(0.01, 0.02, 0.03), rpy=(0.1, 0.2, 0.3)),
        BoxWall(centre=(0.02, 0, 0.05), size=(0.1, 0.2, 0.3), rpy=(0.1, 0.2, 0.3), side="inside"),
    ),
    tubes=(
        TubeWall(points=((0, 0, -0.02), (0, 0, 0.03), (0, 0.015, 0.08), (0, 0.04, 0.13)), radius=(8e-3, 8e-3, 7e-3, 9e-3),
                 closed=True),
        TubeWall(points=((0.03, 0, -0.02), (0.03, 0, 0.03), (0.03, 0.015, 0.08)), radius=(0.004,), side="outside"),
    ),
)  # fmt: skip


@pytest.fixture(scope="module")
def robot():
    return load_robot_file("article").robot


def snapshot(**changes):
    bent = arc_backbone(LENGTH, 0.4, 0.0)
    gravity = np.array([-9.81, 0.0, 0.0])
    return dataclasses.replace(
        Snapshot(
            time=0.0, backbone=bent, gravity=gravity, tension=np.zeros(6), displacement=np.zeros(6), truth=bent, virtual=True
        ),
        **changes,
    )


def test_drawn_surfaces_lie_on_the_walls_and_face_into_the_free_space():
    scene = Scene(SECTION)
    own = scene.turned(np.eye(3))
    for shape in obstacle_shapes(scene, LENGTH):
        rows, normal = np.flatnonzero(own.obstacle == scene.names.index(shape.name)), np.empty(3)
        for vertex in shape.vertices[::37]:
            # The end of the tube is rounded off by two hundredths of a millimetre.
            assert min(abs(gap_to(own, row, vertex, normal)) for row in rows) < 2e-5, shape.name
        for corners in shape.vertices[shape.faces[::41]]:
            out = np.cross(corners[1] - corners[0], corners[2] - corners[0])
            nearest = min((gap_to(own, row, corners.mean(axis=0), normal), tuple(normal)) for row in rows)[1]
            assert out @ np.array(nearest) > 0.5 * np.linalg.norm(out), shape.name
        assert shape.in_world == (shape.name == "plane 2")


def test_the_example_has_a_lumen_a_zone_and_a_table():
    file = load_robot_file(Path(__file__).resolve().parents[1] / "examples" / "lumen_robot.yaml")
    shapes = obstacle_shapes(file.scene, LENGTH) + obstacle_shapes(file.zones, LENGTH, forbidden=True)
    assert {(shape.name, shape.in_world, shape.forbidden) for shape in shapes} == {
        ("table", True, False), ("lumen", False, False), ("vessel", False, True)}  # fmt: skip


def test_a_place_in_the_inset_is_that_of_the_operators_picture():
    """With the picture's axes: the tip's x axis up, its y axis to the right."""
    empty = Scene(SceneSection())
    tip, rotation = np.array([0.01, 0.02, 0.1]), arc_backbone(LENGTH, 0.7, 0.3).at(np.ones(1))[1][0]
    for target in np.random.default_rng(1).normal(0.0, 0.03, (8, 3)) + tip + 0.08 * rotation[:, 2]:
        seen = Camera(empty.arrays, tip[None] + rotation[:, 2], HALF_VIEW).look(tip, rotation, target).target
        own = (target - tip) @ rotation
        right, down = place(np.array([own[1], -own[0], own[2]]))
        if seen is not None:
            np.testing.assert_allclose([-down * HALF_VIEW, right * HALF_VIEW], seen, atol=1e-9)


def test_the_inset_shows_a_wall_on_its_side_and_the_nearer_of_two():
    camera, upright = TipCamera(64, 0.05), np.eye(3)
    below = obstacle_shapes(Scene(SceneSection(planes=(PlaneWall(normal=(1, 0, 0), point=(-0.01, 0, 0)),))), LENGTH)[0]
    ball = obstacle_shapes(Scene(SceneSection(spheres=(SphereWall(centre=(0, 0, 0.14), radius=0.01),))), LENGTH)[0]
    red, blue = (255, 0, 0), (0, 0, 255)
    picture = camera.picture(
        [(below.vertices, below.faces, red), (ball.vertices, ball.faces, blue)], np.array([0, 0, 0.1]), upright
    )
    assert picture[50, 32, 0] > 60 and picture[14, 32, 0] < 40  # x is up: the wall is in the lower half
    assert picture[32, 32, 2] > 60 > picture[32, 32, 0]
    hidden = camera.picture([(ball.vertices, ball.faces, blue)], np.array([0, 0, 0.1]), upright, np.array([0, 0, 0.2]))
    plain = camera.picture([], np.array([0, 0, 0.1]), upright, np.array([0, 0, 0.2]))
    assert 0 < hidden.reshape(-1, 3)[:, 0].max() < 0.6 * plain.reshape(-1, 3)[:, 0].max()  # its ring is dark


def test_the_models_forces_point_out_of_the_wall():
    scene = Scene(SceneSection(planes=(PlaneWall(name="table", normal=(0, 0, 1), point=(0, 0, -0.02), frame="world"),)))
    up = np.array([-1.0, 1.0, 0.0]) / math.sqrt(2.0)
    backbone = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.1]])
    (touch,) = model_touches(scene, -9.81 * up, ["table"], [0.2], np.array([[0.0, 0.0, 0.1]]) - 0.02 * up, backbone)
    np.testing.assert_allclose(touch.force, 0.2 * up, atol=1e-12)


def test_forces_of_one_source_are_added_where_they_act():
    a = Touch("wall", np.zeros(3), np.array([0.0, 0.0, 1.0]))
    b = Touch("wall", np.array([4e-3, 0.0, 0.0]), np.array([0.0, 0.0, 3.0]))
    (total,) = resultants([a, b])
    assert total.size == 4.0 and total.place[0] == pytest.approx(3e-3)


def test_arrows_suit_the_robot_and_its_forces():
    for length, tension, force in ((0.1, 5.0, 0.01), (1.0, 50.0, 30.0)):
        scale = ForceScale(length, tension)
        scale.follow(0.0, force)
        start, end = scale.arrow(Touch("", np.zeros(3), np.array([0.0, 0.0, force])))
        assert 0.15 * length < np.linalg.norm(end - start) < 0.5 * length and not end.any()
        scale.follow(1.0, 0.0)
        assert np.linalg.norm(np.diff(scale.arrow(Touch("", np.zeros(3), np.array([0, 0, force]))), axis=0)) < 0.5 * length
    assert [force_text(f) for f in (0.0123, 0.2, 3.14159, 120.0)] == ["12 mN", "0.2 N", "3.1 N", "120 N"]


def test_forces_of_model_and_virtual_robot_stand_next_to_each_other():
    touch = Touch("<b>", np.zeros(3), np.array([0.0, 0.0, 0.02]))
    text = touches_html(snapshot(model_touches=(touch,), virtual_touches=(touch, touch)))
    assert "20 mN" in text and "40 mN" in text and "<b>" not in text
    assert touches_html(snapshot()) == ""


class Browsers:
    """A page, and what browsers do on it."""

    def __init__(self, robot):
        self.page = Page(robot, PageOptions(port=8890, graphics="light"))
        self.hand, self.wall = self.page._scene.hand, self.page._scene.wall
        self.notified = []
        self.page.notify = lambda title, sentence, good=False: self.notified.append(sentence)

    def drag(self, handle, phase, end, start=(0.0, 0.0, 0.0), browser=0):
        """Send a browser's message about a drag; places in soft_base, m."""
        to_scene = self.page._scene.wall._frame.rotation
        event = types.SimpleNamespace(
            phase=phase,
            client_id=browser,
            start_position=tuple(SCALE * to_scene @ start),
            end_position=end if isinstance(end, str) else tuple(SCALE * to_scene @ end),
        )
        asyncio.run(handle._on_drag(event))


@pytest.fixture
def browsers(robot):
    browsers = Browsers(robot)
    browsers.page.show(snapshot())
    yield browsers
    browsers.page.close()


def test_a_dragged_tip_is_pulled_to_the_cursor_until_the_mouse_lets_go(browsers):
    browsers.drag(browsers.hand, "start", (0.01, 0.0, 0.1))
    browsers.drag(browsers.hand, "update", (0.02, 0.005, 0.09))
    for _ in range(2):  # again and again: the virtual robot lets go of a page that is not heard of
        (push,) = browsers.page.requests()
        np.testing.assert_allclose(push.place, [0.02, 0.005, 0.09], atol=1e-9)
    browsers.drag(browsers.hand, "update", (0.0, 0.0, 0.05), browser=1)  # another browser cannot take it away
    assert browsers.page.requests() == [push]
    browsers.drag(browsers.hand, "end", (0.0, 0.0, 0.0), browser=1)
    assert browsers.page.requests() == [push]
    browsers.drag(browsers.hand, "end", (0.02, 0.005, 0.09))
    assert browsers.page.requests() == [Push(None)] and browsers.page.requests() == []


def test_a_browser_that_leaves_lets_go(browsers):
    browsers.drag(browsers.hand, "start", (0.01, 0.0, 0.1), browser=3)
    assert len(browsers.page.requests()) == 1
    browsers.page._on_disconnect(types.SimpleNamespace(client_id=3))
    assert browsers.page.requests() == [Push(None)]


@pytest.mark.parametrize("state", [{"virtual": False}, {"virtual": False, "truth": None}])
def test_without_a_virtual_robot_there_is_no_handle(browsers, state):
    browsers.drag(browsers.hand, "start", (0.01, 0.0, 0.1))
    browsers.page._scene.show(snapshot(**state))
    assert browsers.page.requests() == []  # what was held is let go
    browsers.drag(browsers.hand, "start", (0.01, 0.0, 0.1))
    browsers.wall.put_up("below")
    browsers.drag(browsers.wall, "start", (0.01, 0.0, 0.1))
    assert browsers.page.requests() == []
    assert not browsers.hand._ball.visible and not browsers.wall._rings.visible


def test_an_earlier_state_has_no_handles(browsers):
    browsers.page._scene.show(snapshot(), live=False)
    browsers.drag(browsers.hand, "start", (0.01, 0.0, 0.1))
    browsers.wall.put_up("below")
    assert browsers.page.requests() == [] and not browsers.hand._ball.visible


def test_a_wall_is_put_next_to_the_robot_and_dragged_along_its_normal(browsers):
    browsers.wall.put_up("below")
    (placed,) = browsers.page.requests()
    point, normal = (np.array(vector) for vector in placed.plane)
    np.testing.assert_allclose(normal, [1.0, 0.0, 0.0], atol=1e-9)
    assert normal @ point < -0.0045 - 0.005  # free of the robot
    browsers.page._scene.show(snapshot(wall=(point, normal)))
    browsers.drag(browsers.wall, "start", (-0.012, 0.0, 0.03), start=(-0.012, 0.0, 0.03))
    browsers.drag(browsers.wall, "update", (-0.010, 0.04, 0.06))  # across the normal nothing moves
    assert np.array(browsers.page.requests()[0].plane[0]) @ normal == pytest.approx(point @ normal + 0.002)
    browsers.drag(browsers.wall, "update", (0.09, 0.0, 0.03))  # not through the base
    assert np.array(browsers.page.requests()[0].plane[0]) @ normal == pytest.approx(-0.0045)
    browsers.drag(browsers.wall, "end", (0.09, 0.0, 0.03))
    browsers.wall.take_away()
    assert browsers.page.requests() == [PlaceWall(None)]


def test_rings_lie_on_the_wall_until_they_are_turned_and_a_drag_begins_at_the_wall_that_is_there(browsers):
    wall, page = browsers.wall, browsers.page
    wall.show_rings(True)
    for normal in (np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.6, 0.8])):  # two programs have put walls there
        page._scene.show(snapshot(wall=(-0.02 * normal, normal)))
        np.testing.assert_allclose(wall._rings.wxyz, wall._patch.wxyz, atol=1e-12)
    event = {"client": object(), "client_id": 4}
    asyncio.run(wall._on_turn(types.SimpleNamespace(phase="start", **event)))
    wall._rings.wxyz = (math.sqrt(0.5), 0.0, math.sqrt(0.5), 0.0)  # by the browser: z to x
    asyncio.run(wall._on_turn(types.SimpleNamespace(phase="update", **event)))
    np.testing.assert_allclose(page.requests()[0].plane[1], [1.0, 0.0, 0.0], atol=1e-9)
    page._scene.show(snapshot(wall=(-0.02 * normal, normal)))  # the wall has not turned yet
    assert wall._rings.wxyz[2] == pytest.approx(math.sqrt(0.5))
    asyncio.run(wall._on_turn(types.SimpleNamespace(phase="end", **event)))
    page._scene.show(snapshot(wall=(-0.02 * normal, normal)))
    np.testing.assert_allclose(wall._rings.wxyz, wall._patch.wxyz, atol=1e-12)
    browsers.drag(wall, "start", -0.02 * normal, start=-0.02 * normal)
    browsers.drag(wall, "update", -0.019 * normal)
    np.testing.assert_allclose(page.requests()[-1].plane[1], normal, atol=1e-9)


@pytest.mark.parametrize("side", ["below", "above", "side", "ahead"])
def test_a_new_wall_is_one_that_the_virtual_robot_takes(browsers, side):
    for gravity in ([-9.81, 0.0, 0.0], [0.0, 0.0, -9.81], [0.0, 0.0, 9.81], [3.0, -4.0, 1.0]):
        browsers.page._scene.show(snapshot(gravity=np.array(gravity)))
        browsers.wall.put_up(side)
        (placed,) = browsers.page.requests()
        order = {"point_mm": [1e3 * x for x in placed.plane[0]], "normal": list(placed.plane[1])}
        assert parse_wall(order, "virtual/wall", LENGTH, 0.0045).frame == "soft_base"


def test_what_no_page_sends_is_refused_with_a_sentence_and_nothing_else_is_lost(browsers):
    put = browsers.page._controls._requests.put
    put(SetTarget(math.nan, 0.0))
    put(TiltBase(0.0, math.inf))
    put(PlaceWall(((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))))
    put(PlaceWall(((0.0, 0.0, math.nan), (0.0, 0.0, 1.0))))
    browsers.drag(browsers.hand, "start", (math.nan, 0.0, 0.1))
    good = SetTarget(0.2, 0.1)
    put(good)
    assert browsers.page.requests() == [good]
    assert len(browsers.notified) == 5 and any("nan mm away" in sentence for sentence in browsers.notified)
    assert browsers.page.requests() == [Push(None)] and len(browsers.notified) == 5  # once, not with every frame
    browsers.drag(browsers.hand, "update", (5.0, 0.0, 0.1))
    assert browsers.page.requests() == [] and "allowed: up to 1000 mm" in browsers.notified[-1]
    browsers.drag(browsers.hand, "update", "here")
    browsers.page.requests()
    assert "nan mm away" in browsers.notified[-1]
    browsers.drag(browsers.hand, "update", (0.01, 0.0, 0.1))
    assert len(browsers.page.requests()) == 1


def test_controls_that_a_browser_sets_to_nonsense_are_refused(browsers):
    page, target = browsers.page, types.SimpleNamespace
    for handle in page._server.gui._gui_input_handle_from_uuid.values():
        if getattr(handle, "label", None) in ("bend °", "roll °", "cables", "motors", "presets"):
            handle._impl.value = "nonsense"
            for callback in handle._impl.update_cb:
                callback(target(client=object(), target=handle))
    assert page.requests() == [] and len(browsers.notified) == 4  # the preset is none, and asks for nothing


def until_closed(connection):
    while True:
        connection.recv(timeout=20.0)


def test_a_browser_that_sends_nonsense_disturbs_no_other(browsers):
    from websockets.exceptions import ConnectionClosed
    from websockets.sync.client import connect

    address = browsers.page.address.replace("http://", "ws://")
    subprotocol = f"viser-v{viser.__version__}"
    with connect(address, subprotocols=[subprotocol], max_size=None) as good:
        for nonsense in (b"\xff\x00\x93", b"", "text", msgspec.msgpack.encode({"type": "NoSuchMessage"})):
            with connect(address, subprotocols=[subprotocol], max_size=None) as bad:
                bad.send(nonsense)
                with pytest.raises(ConnectionClosed):
                    until_closed(bad)
        with contextlib.suppress(TimeoutError):
            while True:  # what the page has sent so far
                good.recv(timeout=0.3)
        browsers.page._status.content = "still here"
        assert good.recv(timeout=20.0)
    assert browsers.page.requests() == []


def test_a_page_of_another_address_cannot_connect(browsers):
    from websockets.exceptions import InvalidStatus
    from websockets.sync.client import connect

    own, subprotocols = browsers.page.address, [f"viser-v{viser.__version__}"]
    address, port = own.replace("http://", "ws://"), own.rpartition(":")[2]
    with connect(address, subprotocols=subprotocols, max_size=None, origin=own) as connection:
        assert connection.recv(timeout=20.0)
    hosts = "https://example.org", "http://localhost", "http://localhost:1", "null", f"http://localhost:{port}.example.org"
    for foreign in hosts:
        with pytest.raises(InvalidStatus) as refused:
            connect(address, subprotocols=subprotocols, max_size=None, origin=foreign)
        assert refused.value.response.status_code == 403
