"""For a replayed recording the node gives the estimates of the offline estimator, bit for bit, with the samples' stamps."""

import gc

import numpy as np
import pytest

rclpy = pytest.importorskip("rclpy")
pytest.importorskip("gravcomp_msgs.msg", reason="the workspace is not built or not sourced")

from geometry_msgs.msg import Vector3Stamped
from gravcomp_estimation.imu_estimator import ImuEstimator
from gravcomp_estimation.imu_replay import ImuReplay
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import Imu
from std_srvs.srv import Trigger

from gravcomp.description import load_robot_file
from gravcomp.orientation import GravityEstimator, estimate_recording
from gravcomp.orientation import quaternion as quat
from gravcomp.recordings.imu import read_recording
from gravcomp_estimation import messages
from gravcomp_msgs.msg import ImuStatus
from gravcomp_node import LATCHED, SENSOR

EVERYTHING = QoSProfile(reliability=ReliabilityPolicy.RELIABLE, history=HistoryPolicy.KEEP_LAST, depth=5000)
RELIABLY = [
    argument
    for topic in ("/imu/data", "/gravity")
    for name, value in (("reliability", "reliable"), ("depth", "5000"))
    for argument in ("-p", f"imu_estimator:qos_overrides.{topic}.publisher.{name}:={value}")
]


@pytest.fixture
def graph():
    """Starts nodes of this package in one executor."""
    graph = Graph()
    yield graph
    graph.close()


class Graph:
    def open(self, *arguments):
        rclpy.init(args=["test", "--ros-args", *arguments])
        self.executor, self.nodes = SingleThreadedExecutor(), []
        self.observer = rclpy.create_node("observer")
        self.executor.add_node(self.observer)

    def start(self, node_class):
        node = node_class()
        self.nodes.append(node)
        self.executor.add_node(node)
        node.start()
        return node

    def spin_until(self, done, turns=20000):
        for _ in range(turns):
            if done():
                return
            self.executor.spin_once(timeout_sec=0.05)
        pytest.fail("the awaited event did not happen")

    def close(self):
        for node in self.nodes:
            node.shut_down()
            node.destroy_node()
        self.observer.destroy_node()
        rclpy.shutdown()


def write_trial(path, count=300):
    random = np.random.default_rng(1)
    np.savez(
        path, gyr=random.normal(0, 0.3, (count, 3)), acc=np.array([0, 0, 9.81]) + random.normal(0, 0.5, (count, 3)), rate=100.0
    )
    return path


def test_a_replay_gives_the_estimates_of_the_offline_estimator(graph, tmp_path):
    trial = write_trial(tmp_path / "trial.npz")
    graph.open(
        *("-p", f"imu_replay:file:={trial}", "-p", "imu_replay:rate:=0.0", "-p", "imu_replay:exit_at_end:=false"), *RELIABLY
    )
    orientation, gravity = [], []
    estimator = graph.start(ImuEstimator)
    graph.observer.create_subscription(Imu, "imu/data", orientation.append, EVERYTHING)
    graph.observer.create_subscription(Vector3Stamped, "gravity", gravity.append, EVERYTHING)
    graph.spin_until(lambda: estimator.count_subscribers("gravity") == 1)
    # The overrides of two topics do not affect others.
    (bias,) = graph.observer.get_publishers_info_by_topic("imu/bias")
    assert bias.qos_profile.reliability == SENSOR.reliability == ReliabilityPolicy.BEST_EFFORT and SENSOR.depth == 5
    graph.start(ImuReplay)
    graph.spin_until(lambda: len(gravity) == 300 and len(orientation) == 300)

    mount = quat.from_roll_pitch_yaw(*load_robot_file("article").robot.imu_mount.rpy)
    expected = estimate_recording(read_recording(trial), GravityEstimator(mount=mount))
    assert [messages.stamp_ns(m.header) - 1_000_000_000 for m in gravity] == expected.stamp_ns.tolist()
    assert np.array_equal([[m.vector.x, m.vector.y, m.vector.z] for m in gravity], expected.gravity)
    q = [[m.orientation.w, m.orientation.x, m.orientation.y, m.orientation.z] for m in orientation]
    assert np.array_equal(q, expected.orientation)
    assert gravity[0].header.frame_id == "soft_base" and orientation[0].header.frame_id == "imu_link"
    assert orientation[-1].orientation_covariance[0] > 0.0


def test_a_configured_node_leaves_little_to_the_garbage_collector(graph):
    graph.open()
    graph.start(ImuEstimator)
    try:
        assert gc.get_freeze_count() > 20 * len(gc.get_objects())
    finally:
        gc.unfreeze()


def test_late_subscribers_receive_the_status_and_reset_restarts(graph):
    graph.open()
    node = graph.start(ImuEstimator)
    publisher = graph.observer.create_publisher(Imu, "imu/data_raw", 5)
    random = np.random.default_rng(2)

    def feed(count, start):
        for k in range(start, start + count):
            gyro, accel = random.normal(0.02, 0.002, 3), np.array([0, 0, 9.81]) + random.normal(0, 0.02, 3)
            publisher.publish(messages.raw_imu(10**9 + k * 10_000_000, "imu_link", gyro.tolist(), accel.tolist()))
            graph.executor.spin_once(timeout_sec=0.05)

    graph.spin_until(lambda: publisher.get_subscription_count() == 1)
    feed(400, 0)
    statuses = []
    graph.observer.create_subscription(ImuStatus, "imu/status", statuses.append, LATCHED)
    graph.spin_until(lambda: bool(statuses))
    graph.spin_until(lambda: node._estimate is not None and node._estimate.imu.rest)
    client = graph.observer.create_client(Trigger, "imu_estimator/reset")
    graph.spin_until(client.service_is_ready)
    future = client.call_async(Trigger.Request())
    graph.spin_until(future.done)
    assert future.result().success
    feed(1, 1000)
    graph.spin_until(lambda: node._estimate is not None)
    assert not node._estimate.imu.rest and node._estimate.bias == (0.0, 0.0, 0.0)


def test_a_replay_without_a_file_is_refused(graph):
    from gravcomp.config import ConfigError

    graph.open()
    with pytest.raises(ConfigError, match="the parameter file is empty"):
        graph.start(ImuReplay)
