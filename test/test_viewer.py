"""The viewer in a headless browser: it renders and follows the graph, a control changes the robot, nothing leaves the machine."""

import io
import socket
import threading
import time

import numpy as np
import pytest

from gravcomp.view.browser import Browser, find_chromium

rclpy = pytest.importorskip(
    "rclpy", reason="the viewer's test publishes gravity: it runs inside the environment, by ./gravcomp test"
)

# Software rendering on a busy machine.
PATIENCE = 240.0

pytestmark = [
    pytest.mark.nodes,
    pytest.mark.skipif(find_chromium() is None, reason="no Chromium on this machine: apt-get install chromium"),
    pytest.mark.timeout(900),
]


class Robot:
    """Publishes gravity and receives the tip of the model."""

    def __init__(self):
        from geometry_msgs.msg import PoseStamped, Vector3Stamped
        from rclpy.executors import SingleThreadedExecutor

        from gravcomp_node import SENSOR

        rclpy.init()
        self.node = rclpy.create_node("viewer_test")
        self.tip = None
        self._gravity = self.node.create_publisher(Vector3Stamped, "gravity", SENSOR)
        self._message = Vector3Stamped()
        self._message.vector.x = -9.81
        self.node.create_subscription(PoseStamped, "robot/tip", self._on_tip, SENSOR)
        self.node.create_timer(0.02, self._publish)
        # An executor of this test: the common one of rclpy does not work after the shutdown by another test.
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._spin)
        self._thread.start()

    def _spin(self):
        while not self._stopped.is_set():
            self._executor.spin_once(timeout_sec=0.1)

    def _publish(self):
        self._message.header.stamp = self.node.get_clock().now().to_msg()
        self._gravity.publish(self._message)

    def _on_tip(self, message):
        p = message.pose.position
        self.tip = np.array([p.x, p.y, p.z])

    def close(self):
        self._stopped.set()
        self._thread.join()
        self.node.destroy_node()
        rclpy.try_shutdown()


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    """The page of a viewer with simulator and controller, in the ROS domain of this process."""
    from gravcomp.launcher import Graph
    from gravcomp.launcher.host_client import NodeHost
    from gravcomp.launcher.robot_graph import RobotGraph

    graph = RobotGraph("article")
    viewer = graph.node("gravcomp_fem", "viewer", port=8800, rate=10.0, graphics="light")
    specs = [graph.node("gravcomp_fem", "fem_simulator"), graph.node("gravcomp_fem", "inverse_controller"), viewer]
    with Graph(specs, tmp_path_factory.mktemp("logs"), host=NodeHost()) as processes:
        processes.start()
        log = processes.processes[viewer.name].log
        processes.wait(lambda: "the page is at" in log.read_text(encoding="utf-8"), PATIENCE, "the viewer's start")
        yield log.read_text(encoding="utf-8").split("the page is at ")[1].split()[0]


@pytest.fixture(scope="module")
def robot(address):
    robot = Robot()
    yield robot
    robot.close()


@pytest.fixture(scope="module")
def browser(address, robot):
    with Browser(width=1100, height=500, patience=PATIENCE) as browser:
        browser.open(address)
        yield browser


@pytest.fixture(scope="module")
def page(browser):
    return browser.page


def test_the_page_shows_the_message_of_the_controller(page):
    page.wait_for_function("document.querySelector('[data-gravcomp=status]').innerText.includes('target')", polling=500)


def test_the_robot_is_drawn(browser):
    """Thousands of colours next to the panels: shaded surfaces on the gradient of the background, not an empty canvas."""
    from PIL import Image

    end = time.monotonic() + PATIENCE
    while True:
        picture = np.asarray(Image.open(io.BytesIO(browser.picture())).convert("RGB"))
        middle = picture[:, 420:680].reshape(-1, 3)
        colours = len(np.unique(middle, axis=0))
        if colours > 800:
            return
        assert time.monotonic() < end, f"{colours} colours in the middle of the page"
        time.sleep(2.0)


def test_every_curve_has_a_range(page):
    """Also without values for one of them: this robot has no ground truth."""
    ranges = page.evaluate(
        "Object.values(window.__viserTestpoints.uplots).map(u => [u.chart.scales.y.min, u.chart.scales.y.max])"
    )
    assert len(ranges) == 4 and all(low is not None and high > low for low, high in ranges), ranges


def test_a_control_bends_the_robot(browser, robot):
    end = time.monotonic() + PATIENCE
    browser.set_slider("bend °", 40)
    # An arc of 100 mm bent by 40 degrees ends 33.5 mm from the axis.
    while robot.tip is None or np.hypot(*robot.tip[:2]) < 0.028:
        assert time.monotonic() < end, f"the tip is at {robot.tip}"
        time.sleep(0.2)
    assert robot.tip[0] > 0.028 and abs(robot.tip[1]) < 0.005


def test_it_works_offline(browser):
    assert not browser.foreign


def test_it_listens_on_this_machine_only(address):
    port = int(address.rsplit(":", 1)[1])
    own = {a[4][0] for a in socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET)} - {"127.0.0.1", "127.0.1.1"}
    for host in own:
        with socket.socket() as probe:
            probe.settimeout(2.0)
            assert probe.connect_ex((host, port)) != 0
