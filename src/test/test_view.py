"""The page without a browser: geometry, orientation of the base, history of the plots, controls, port."""

import math
import socket
import types

import numpy as np
import pytest

from gravcomp.config import ConfigError
from gravcomp.description import load_robot_file
from gravcomp.view.backbone import Backbone, arc_backbone, rest_backbone
from gravcomp.view.colours import tension_colour
from gravcomp.view.graphics import chosen
from gravcomp.view.history import History
from gravcomp.view.page import free_port
from gravcomp.view.plots import top_of
from gravcomp.view.requests import BridgeService, Compensate, InjectFault, Record, SetTarget, TiltBase
from gravcomp.view.scale import SCALE
from gravcomp.view.skin import cable_skin, joined
from gravcomp.view.snapshot import Snapshot, TargetView
from gravcomp.view.status import cables_html, status_html
from gravcomp.view.wall import lumen_skin, wall_skins
from gravcomp.view.world import BaseInWorld, quaternion_wxyz


@pytest.fixture(scope="module")
def robot():
    return load_robot_file("article").robot


def test_eleven_points_of_an_arc_are_enough_to_draw_it():
    coarse, fine = arc_backbone(0.1, 1.2, 0.4, points=11), arc_backbone(0.1, 1.2, 0.4, points=201)
    position, rotation = coarse.at(fine.station)
    # 0.01 mm is less than a pixel.
    assert np.abs(position - fine.position).max() < 1e-5
    np.testing.assert_allclose(np.linalg.det(rotation), 1.0, atol=1e-9)
    _, exact = fine.at(fine.station)
    np.testing.assert_allclose(rotation[:, :, 2], exact[:, :, 2], atol=2e-3)


def test_stations_beyond_the_ends_are_the_ends():
    backbone = arc_backbone(0.1, 0.5, 0.0)
    position, _ = backbone.at(np.array([-0.1, 1.1]))
    np.testing.assert_allclose(position, [[0, 0, 0], backbone.tip], atol=1e-12)


def test_quaternions_of_opposite_sign_are_the_same_frame():
    backbone = arc_backbone(0.1, 0.8, 1.0, points=9)
    flipped = Backbone(backbone.station, backbone.position, backbone.orientation * np.where(np.arange(9) % 2, -1.0, 1.0)[:, None])
    stations = np.linspace(0, 1, 50)
    for a, b in zip(backbone.at(stations), flipped.at(stations)):
        np.testing.assert_allclose(a, b, atol=1e-12)


def test_walls_at_rest_have_the_robots_dimensions(robot):
    straight = rest_backbone(robot)
    vertices = np.concatenate([skin.on(straight) for skin in wall_skins(robot)])
    assert np.hypot(vertices[:, 0], vertices[:, 1]).max() == pytest.approx(0.0045, rel=1e-5)
    assert vertices[:, 2].min() == pytest.approx(0.0, abs=1e-9) and vertices[:, 2].max() == pytest.approx(0.1, rel=1e-6)
    lumen = lumen_skin(robot).on(straight)
    np.testing.assert_allclose(np.hypot(lumen[:, 0], lumen[:, 1]), 0.0018, rtol=1e-4)


def test_a_bent_wall_keeps_its_distance_from_the_backbone(robot):
    backbone = arc_backbone(robot.length, 1.0, 0.7)
    skin = wall_skins(robot)[0]
    centre, rotation = backbone.at(skin.station)
    away = skin.on(backbone) - centre
    np.testing.assert_allclose(np.linalg.norm(away, axis=1), 0.0045, rtol=1e-4)
    np.testing.assert_allclose(np.einsum("vi,vi->v", away, rotation[:, :, 2]), 0.0, atol=1e-8)


def test_surfaces_face_outward(robot):
    straight = rest_backbone(robot)
    for skin in wall_skins(robot):
        v = skin.on(straight).astype(float)
        a, b, c = (v[skin.faces[:, i]] for i in range(3))
        normal, middle = np.cross(b - a, c - a), (a + b + c) / 3
        side = np.abs(normal[:, 2]) < 1e-3 * np.linalg.norm(normal, axis=1)
        assert (np.einsum("fi,fi->f", normal[side, :2], middle[side, :2]) > 0.0).all()


def test_a_cable_runs_at_its_angle_to_the_end_of_its_segment(robot):
    for cable in robot.cables:
        vertices = cable_skin(robot, cable).on(rest_backbone(robot))
        middle = vertices.reshape(-1, 8, 3).mean(axis=1)
        np.testing.assert_allclose(
            middle[:, :2],
            np.tile(0.00315 * np.array([math.cos(cable.angle), math.sin(cable.angle)]), (len(middle), 1)),
            atol=1e-7,
        )
        assert middle[-1, 2] == pytest.approx(robot.cable_end(cable))


def test_joined_skins_are_deformed_as_each_alone(robot):
    skins = [*wall_skins(robot), lumen_skin(robot), cable_skin(robot, robot.cables[3])]
    together, parts = joined(skins)
    backbone = arc_backbone(robot.length, 0.9, -0.3)
    vertices = together.on(backbone)
    for skin, part in zip(skins, parts):
        np.testing.assert_allclose(vertices[part], skin.on(backbone), atol=1e-8)


def test_gravity_always_points_down():
    world, random = BaseInWorld(), np.random.default_rng(1)
    gravity = np.array([-9.81, 0.0, 0.0])
    for _ in range(500):
        gravity = gravity + random.normal(0.0, 1.5, 3)
        rotation = world.follow(gravity)
        np.testing.assert_allclose(rotation @ gravity / np.linalg.norm(gravity), [0, 0, -1], atol=1e-9)
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-9)


def test_the_heading_is_kept_while_the_robot_passes_the_vertical():
    """While the robot tilts from 30 to 150 degrees, its horizontal transverse axis does not move."""
    world = BaseInWorld()
    for inclination in np.radians(np.arange(30.0, 150.0, 1.0)):
        rotation = world.follow(9.81 * np.array([-math.cos(inclination), 0.0, -math.sin(inclination)]))
        np.testing.assert_allclose(rotation[:, 1], [0, -1, 0], atol=1e-6)


def test_no_gravity_changes_nothing():
    world = BaseInWorld()
    before = world.follow(np.array([0.0, -9.81, 0.0])).copy()
    np.testing.assert_array_equal(world.follow(np.zeros(3)), before)


def test_a_quaternion_of_a_rotation_gives_the_rotation():
    random = np.random.default_rng(2)
    for _ in range(20):
        q = random.normal(size=4)
        q /= np.linalg.norm(q) * np.sign(q[0])
        w, x, y, z = q
        rotation = Backbone(np.array([0.0, 1.0]), np.array([[0, 0, 0], [0, 0, 1.0]]), np.array([[x, y, z, w]] * 2)).at(
            np.array([0.0])
        )[1][0]
        np.testing.assert_allclose(quaternion_wxyz(rotation), q, atol=1e-7)


def test_the_history_keeps_its_span_and_no_more():
    history = History(1, span=4.0, rate=20.0)
    for i in range(1000):
        history.add(i * 0.05, np.array([float(i)]))
    time, value = history.columns(2.0)
    assert time[-1] == 0.0 and time[0] == pytest.approx(-2.0) and len(time) == 41
    assert value[-1] == 999.0 and value[0] == 959.0
    earlier, value = history.columns(2.0, until=998 * 0.05 - 1.001)
    np.testing.assert_allclose(earlier, time)
    assert value[-1] == 977.0
    assert not len(history.columns(2.0, until=0.0)[0])  # older than the history


def test_an_axis_ends_above_its_values_and_is_kept_while_it_fits():
    assert top_of(np.array([np.nan, 1.7, 0.2]), 1.0, 1.0) == 2.0
    assert top_of(np.array([29.9, np.nan]), 2.0, 1.0) == 50.0
    assert top_of(np.array([16.0]), 50.0, 1.0) == 50.0 and top_of(np.array([14.0]), 50.0, 1.0) == 20.0
    assert top_of(np.full(3, np.nan), 50.0, 1.0) == 1.0 and top_of(np.zeros(3), 1.0, 1.0) == 1.0
    assert top_of(np.array([0.03]), 0.2, 0.2) == 0.2 and top_of(np.array([0.19]), 0.5, 0.2) == 0.5


def test_a_time_that_goes_back_clears_the_history():
    history = History(1, span=2.0, rate=20.0)
    for t in (10.0, 11.0, 5.0):
        history.add(t, np.array([t]))
    assert history.columns(2.0)[1].tolist() == [5.0]


def test_errors_are_distances_to_the_target(robot):
    target = TargetView(np.array([0.0, 0.0, 0.1]))
    snapshot = Snapshot(time=0.0, backbone=arc_backbone(0.1, 0.5, 0.0), truth=arc_backbone(0.1, 0.0, 0.0), target=target)
    assert snapshot.tip_error == pytest.approx(np.linalg.norm(arc_backbone(0.1, 0.5, 0.0).tip - [0, 0, 0.1]))
    assert snapshot.true_tip_error == pytest.approx(0.0, abs=1e-12)
    assert math.isnan(Snapshot(time=0.0).tip_error)


def test_texts_from_the_graph_are_escaped(robot):
    snapshot = Snapshot(time=0.0, status="<script>alert(1)</script>", tension=np.zeros(6), displacement=np.zeros(6))
    assert "<script>" not in status_html(snapshot)
    assert "<b>" not in cables_html(snapshot, ("<b>",) * 6, 1.0)


def test_the_motors_state_is_shown_next_to_the_controllers():
    stopped = status_html(
        Snapshot(
            time=0.0, status="the target is kept", status_level="ok", motors_state="stopped", motors_message="no current <b>"
        )
    )
    assert "the target is kept" in stopped and "motors stopped: no current &lt;b&gt;" in stopped and "#ef4444" in stopped
    assert "motors homing: winding in" in status_html(
        Snapshot(time=0.0, motors_state="homing", motors_message="homing: winding in")
    )
    assert "motors" not in status_html(Snapshot(time=0.0, status="the target is kept"))


def test_colours_of_tension_run_from_dark_to_bright():
    brightness = [sum(tension_colour(t, 1.0)) for t in np.linspace(0.0, 1.0, 11)]
    assert all(a < b for a, b in zip(brightness, brightness[1:]))
    assert tension_colour(-1.0, 1.0) == tension_colour(0.0, 1.0) and tension_colour(9.0, 1.0) == tension_colour(1.0, 1.0)


def test_the_next_free_port_is_taken():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        assert port < free_port("127.0.0.1", port) <= port + 50


def test_an_address_that_is_not_this_machines_is_refused():
    with pytest.raises(ConfigError, match=r"host is '203\.0\.113\.7'; an address of this machine is needed"):
        free_port("203.0.113.7", 8080)


class Clicks:
    """Operates the controls of a page, as a browser does."""

    def __init__(self, robot):
        from gravcomp.view.options import PageOptions
        from gravcomp.view.page import Page

        self.page = Page(robot, PageOptions(port=8890, graphics="full"))
        self.controls, self.scene = self.page._controls, self.page._scene

    def set(self, handle, value=None) -> list:
        """Set the value of a control (a button has none), and return the requests."""
        if value is not None:
            handle._impl.value = value
        for callback in handle._impl.update_cb:
            callback(types.SimpleNamespace(client=object(), target=handle))
        return self.page.requests()

    def handle(self, label: str):
        """Return the control with this label."""
        (found,) = [h for h in self.page._server.gui._gui_input_handle_from_uuid.values() if getattr(h, "label", None) == label]
        return found


@pytest.fixture
def clicks(robot):
    clicks = Clicks(robot)
    yield clicks
    clicks.page.close()


def test_sliders_set_target_and_tilt(clicks):
    clicks.set(clicks.handle("bend °"), 40.0)
    assert clicks.set(clicks.handle("plane °"), 90.0) == [SetTarget(math.radians(40.0), math.radians(90.0))]
    assert clicks.set(clicks.handle("inclination °"), -45.0) == [TiltBase(math.radians(-45.0), 0.0)]
    assert clicks.set(clicks.handle("presets"), "135°") == [TiltBase(math.radians(135.0), 0.0)]
    assert clicks.set(clicks.handle("Straight")) == [SetTarget(0.0, math.radians(90.0))]


def test_a_dragged_handle_requests_the_arc_through_it(clicks, robot):
    wanted = arc_backbone(robot.length, math.radians(50.0), math.radians(-30.0))
    gizmo = clicks.scene.target.gizmo
    gizmo.position = SCALE * wanted.tip
    for callback in gizmo._impl_aux.update_cb:
        callback(types.SimpleNamespace(client=object(), target=gizmo))
    (request,) = clicks.page.requests()
    assert math.degrees(request.angle) == pytest.approx(50.0, abs=0.01) and math.degrees(request.plane) == pytest.approx(
        -30.0, abs=0.01
    )
    # The sliders follow the handle.
    assert clicks.handle("bend °").value == pytest.approx(50.0, abs=0.1)


def test_a_checkbox_shows_the_handle(clicks):
    assert not clicks.scene.target.gizmo.visible
    clicks.set(clicks.handle("drag the target"), True)
    assert clicks.scene.target.gizmo.visible


def test_buttons_raise_their_requests(clicks):
    for label, mode in (("Compensate", "compensate"), ("Hold", "hold"), ("Release", "relax")):
        assert clicks.set(clicks.handle("cables"), label) == [Compensate(mode)]
    assert clicks.set(clicks.handle("motors"), "Stop") == [BridgeService("stop")]
    assert clicks.set(clicks.handle("Record a bag")) == [Record(True)]
    clicks.controls.show_recording(True)
    assert clicks.set(clicks.handle("Stop recording")) == [Record(False)]


def test_every_offered_fault_is_one_of_the_virtual_robot(clicks, robot):
    import yaml

    from gravcomp.virtual.faults import Fault

    kinds = clicks.handle("fault")
    clicks.set(clicks.handle("cable"), robot.cable_names[4])
    for option in kinds.options:
        clicks.set(kinds, option)
        (request,) = clicks.set(clicks.handle("Inject"))
        fault = Fault.parse(yaml.safe_load(request.text), "page")
        assert fault.duration == 2.0
        assert fault.cable == (robot.cable_names[4] if "the cable" in option else "")
    assert clicks.set(clicks.handle("Clear all")) == [InjectFault("clear")]


def test_looking_back_shows_an_earlier_state_while_the_robot_runs(clicks, robot):
    shown = lambda: clicks.page._status.content  # noqa: E731
    angle = lambda i: math.radians(0.1 * i)  # noqa: E731

    def frame(i):
        bent = arc_backbone(robot.length, angle(i), 0.0)
        clicks.page.show(
            Snapshot(time=0.05 * i, status=f"frame {i}", backbone=bent, tension=np.zeros(6), displacement=np.zeros(6))
        )

    for i in range(200):  # 10 s
        frame(i)
    clicks.set(clicks.handle("look back s"), 4.0)
    for i in range(200, 260):
        frame(i)
        # 4 s before the frame at which the page was held, not before the current one.
        assert "frame 120" in shown() and "4.0 s ago" in shown()
    tip = SCALE * arc_backbone(robot.length, angle(120), 0.0).tip
    wall = np.concatenate([handle.vertices for handle in clicks.scene.body])
    assert np.linalg.norm(wall - tip, axis=1).min() < SCALE * 0.0045
    clicks.set(clicks.handle("look back s"), 1.0)
    frame(260)
    assert "frame 180" in shown()
    clicks.page._on_disconnect(types.SimpleNamespace(client_id=0))  # the last browser leaves
    for i in range(261, 290):
        frame(i)
    assert "frame 2" in shown() and "ago" not in shown()


def test_light_graphics_have_no_shadows_and_reflections(clicks):
    lights = clicks.scene.surroundings
    assert lights.key.cast_shadow and lights.rim.visible and not lights.sky.visible
    clicks.set(clicks.handle("graphics"), "light")
    assert not lights.key.cast_shadow and not lights.rim.visible and lights.sky.visible
    clicks.set(clicks.handle("graphics"), "full")
    assert lights.key.cast_shadow and not lights.sky.visible


def test_without_a_graphics_chip_graphics_are_light(tmp_path):
    assert chosen("auto", tmp_path) == "light" and chosen("full", tmp_path) == "full"
    (tmp_path / "dri").mkdir()
    (tmp_path / "dri" / "renderD128").touch()
    assert chosen("auto", tmp_path) == "full" and chosen("light", tmp_path) == "light"


def test_a_lumen_is_drawn_where_there_is_one(robot):
    from gravcomp.view.options import LumenOptions, PageOptions
    from gravcomp.view.page import Page

    for lumen, there in ((LumenOptions(diameter=0.03, bend=0.5), True), (LumenOptions(), False)):
        page = Page(robot, PageOptions(port=8890, lumen=lumen))
        names = [name for name in page._server.scene._handle_from_node_name if "lumen_wall" in name]
        page.close()
        assert bool(names) == there
