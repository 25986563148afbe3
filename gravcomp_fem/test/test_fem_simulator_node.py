"""The simulator as a node: forces of the base's turn, from the rate in imu/data; loads and measurements that cannot be right."""

import os
import time

os.environ.setdefault("ROS_DOMAIN_ID", str(100 + os.getpid() % 100))

import numpy as np
import pytest
import rclpy
import yaml
from geometry_msgs.msg import PoseStamped, Vector3Stamped, WrenchStamped
from gravcomp_fem.conversion import vector_of
from gravcomp_fem.fem_simulator import FemSimulator
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.time import Time
from sensor_msgs.msg import Imu, JointState

from gravcomp.description.robot_file import robot_path
from gravcomp.launcher.model_builder import MARK
from gravcomp_msgs.msg import Deformation
from gravcomp_node import SENSOR

GRAVITY = np.array([-9.81, 0.0, 0.0])
CHANGE = 2.0  # rad/s^2 about x of soft_base
PERIOD_NS = 10_000_000


class Stand:
    """The simulator, and what it receives. shapes: gravity of each deformation, and what the turn adds to it."""

    def __init__(self, *arguments):
        rclpy.init(args=["test", *arguments])
        self.executor, self.simulator = SingleThreadedExecutor(), FemSimulator()
        self.other = rclpy.create_node("other", use_global_arguments=False)
        self.gravity = self.other.create_publisher(Vector3Stamped, "gravity", SENSOR)
        self.imu = self.other.create_publisher(Imu, "imu/data", SENSOR)
        self.shapes: list[tuple[np.ndarray, np.ndarray]] = []
        self.other.create_subscription(Deformation, "robot/deformation", self._on_shape, SENSOR)
        for node in (self.simulator, self.other):
            self.executor.add_node(node)
        self.simulator.start()
        self.now = 1_000_000_000_000

    def _on_shape(self, message):
        self.shapes.append((vector_of(message.gravity), vector_of(message.turn_acceleration)))

    def sample(self, rate=None):
        """Publish a sample of gravity and then of the rate (rad/s about x of soft_base), and wait for the shape."""
        self.now += PERIOD_NS
        stamp = Time(nanoseconds=self.now).to_msg()
        gravity, imu = Vector3Stamped(), Imu()
        gravity.header.stamp = imu.header.stamp = stamp
        gravity.vector.x, gravity.vector.y, gravity.vector.z = GRAVITY
        seen, end = len(self.shapes), time.monotonic() + 60.0
        self.gravity.publish(gravity)
        while len(self.shapes) == seen:
            assert time.monotonic() < end, "no shape arrives"
            self.executor.spin_once(timeout_sec=0.01)
        if rate is not None:
            in_imu = self.simulator.robot_file.robot.imu_mount.rotation.T @ [rate, 0.0, 0.0]
            imu.angular_velocity.x, imu.angular_velocity.y, imu.angular_velocity.z = in_imu.tolist()
            self.imu.publish(imu)
        return self.shapes[-1]

    def close(self):
        self.simulator.shut_down()
        self.simulator.destroy_node()
        self.other.destroy_node()
        self.executor.shutdown()
        rclpy.shutdown()


@pytest.fixture
def stand(monkeypatch):
    monkeypatch.setenv(MARK, "1")  # no reduced model is built during the test
    stand = Stand()
    yield stand
    stand.close()


def test_a_turn_that_becomes_faster_pulls_across_and_along_the_robot(stand):
    end = time.monotonic() + 60.0
    while not (stand.imu.get_subscription_count() and stand.gravity.get_subscription_count()):
        assert time.monotonic() < end, "the simulator subscribes to nothing"
        stand.executor.spin_once(timeout_sec=0.01)
    step, rate = CHANGE * PERIOD_NS * 1e-9, 0.0
    while not stand.sample(rate)[1].any():  # the simulator may find the publisher of imu/data late
        assert time.monotonic() < end, "the rate does not arrive"
        rate += step
    for _ in range(60):
        rate += step
        gravity, added = stand.sample(rate)
        assert gravity == pytest.approx(GRAVITY)
    height = 11.0 / 15.0 * stand.simulator.robot_file.robot.length
    assert added[0] == pytest.approx(0.0, abs=1e-9)
    assert added[1] == pytest.approx(CHANGE * height, rel=0.05)
    assert 0.8 < added[2] / (height * rate**2) < 1.0
    for _ in range(12):
        _, added = stand.sample()
    assert added == pytest.approx(np.zeros(3))


@pytest.fixture
def loaded(monkeypatch, tmp_path):
    """A stand whose robot may be loaded, looks for a payload, and has a coarse mesh."""
    monkeypatch.setenv(MARK, "1")
    described = yaml.safe_load(robot_path("article").read_text(encoding="utf-8"))
    described["robot"] |= {"max_wrench": {"force": 0.2, "moment": 0.002}, "elements": {"around": 4, "along": 4}}
    described["nodes"]["fem_simulator"] = {"load": {"kind": "payload"}}
    (tmp_path / "robot.yaml").write_text(yaml.safe_dump(described), encoding="utf-8")
    stand = Stand("--ros-args", "-p", f"robot:={tmp_path / 'robot.yaml'}")
    yield stand
    stand.close()


def test_loads_and_measurements_that_cannot_be_right_are_named_and_change_nothing(loaded):
    names, now = loaded.simulator.robot_file.robot.cable_names, loaded.other.get_clock().now

    def wrench(frame="soft_tip", force=0.1, late=0.0):
        message = WrenchStamped()
        message.header.frame_id, message.header.stamp = frame, Time(nanoseconds=now().nanoseconds - int(1e9 * late)).to_msg()
        message.wrench.force.x = force
        return message

    def tip(frame="soft_base", z=0.1, late=0.0):
        message = PoseStamped()
        message.header.frame_id, message.header.stamp = frame, Time(nanoseconds=loaded.now - int(1e9 * late)).to_msg()
        message.pose.position.z = z
        return message

    def cells(named=names, tension=0.5, late=0.0):
        message = JointState(name=named, effort=[tension] * len(named))
        message.header.stamp = Time(nanoseconds=loaded.now - int(1e9 * late)).to_msg()
        return message

    cases = [
        ("external/wrench", WrenchStamped, lambda: wrench(frame="elbow"), "in the frame 'elbow'"),
        ("external/wrench", WrenchStamped, lambda: wrench(force=1e4), "1e+04 N"),
        ("external/wrench", WrenchStamped, lambda: wrench(force=np.nan), "finite numbers are needed"),
        ("external/wrench", WrenchStamped, lambda: wrench(late=9.0), "s old"),
        ("measured/tip", PoseStamped, lambda: tip(frame="camera"), "its frame is 'camera'"),
        ("measured/tip", PoseStamped, lambda: tip(z=np.nan), "measured/tip is not used: it is not finite"),
        ("measured/tip", PoseStamped, lambda: tip(z=100.0), "its unit or frame?"),
        ("measured/tip", PoseStamped, lambda: tip(late=30.0), "30 s before that of gravity"),
        ("measured/tension", JointState, lambda: cells(named=names[:3]), "one of each is needed"),
        ("measured/tension", JointState, lambda: cells(tension=np.nan), "is not a finite number"),
        ("measured/tension", JointState, lambda: cells(tension=1e3), "its unit?"),
        ("measured/tension", JointState, lambda: cells(late=30.0), "30 s before that of gravity"),
        ("measured/tension", JointState, lambda: cells(), "is stuck at 0.5 N"),
    ]
    publishers = {topic: loaded.other.create_publisher(kind, topic, SENSOR) for topic, kind, *_ in cases}
    end = time.monotonic() + 120.0
    while not all(one.get_subscription_count() for one in (loaded.gravity, *publishers.values())):
        assert time.monotonic() < end, "the simulator subscribes to nothing"
        loaded.executor.spin_once(timeout_sec=0.01)
    for topic, _, message, reason in cases:
        while reason not in loaded.simulator._sentence:
            assert time.monotonic() < end, f"{reason} is not named; {loaded.simulator._sentence}"
            publishers[topic].publish(message())
            loaded.sample()
    (heavy,) = loaded.simulator.set_parameters([Parameter("payload_mass_g", value=200.0)])
    assert not heavy.successful and "the cables hold at most" in heavy.reason
    carried = loaded.simulator._loads.carried(GRAVITY, 1e-9 * loaded.now)
    assert np.abs([one.force for one in carried]).max(initial=0.0) < 1e-6


def test_a_shape_is_published_before_its_error_is_measured(stand):
    """The measurement takes as long as a step of the full model, and the command waits for the shape only."""
    seen, publish = [], stand.simulator._deformation.publish
    stand.simulator._deformation.publish = lambda message: (seen.append("published"), publish(message))
    stand.simulator._simulator.measure_error = lambda: seen.append("measured")
    stand.sample()
    stand.sample()
    assert seen == 2 * ["published", "measured"]
