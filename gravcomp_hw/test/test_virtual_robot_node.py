"""The node virtual_robot: topics of the ground truth, orientation of the base, faults, refusals."""

import os
import time
from types import SimpleNamespace

os.environ.setdefault("ROS_DOMAIN_ID", str(100 + os.getpid() % 100))

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import PoseArray, PoseStamped, QuaternionStamped, Vector3Stamped
from gravcomp_hw.virtual_robot import VirtualRobotNode
from rclpy.executors import SingleThreadedExecutor
from std_msgs.msg import String

from gravcomp.config import ConfigError
from gravcomp_msgs.msg import VirtualForces
from gravcomp_node import COMMAND, SENSOR


class Graph:
    """The node and a listener in one executor."""

    def __init__(self, *parameters: str):
        overrides = [
            part for p in ("interface:=virtual", f"channel:=node{time.monotonic_ns()}", *parameters) for part in ("-p", p)
        ]
        rclpy.init(args=["test", "--ros-args", *overrides])
        self.executor = SingleThreadedExecutor()
        self.node, self.received = None, {}

    def __enter__(self):
        return self

    def start(self):
        self.node = VirtualRobotNode()
        self.listener = rclpy.create_node("listener", use_global_arguments=False)
        for topic, kind in (("truth/tip", PoseStamped), ("truth/backbone", PoseArray), ("truth/gravity", Vector3Stamped)):
            self.listener.create_subscription(kind, topic, lambda m, t=topic: self.received.update({t: m}), SENSOR)
        self.executor.add_node(self.node)
        self.executor.add_node(self.listener)
        self.node.start()
        return self

    def bystander(self, what):
        """Start; return the publisher of a user's orders for `what` when shape and forces arrive."""
        self.start()
        self.listener.create_subscription(VirtualForces, "truth/forces", lambda m: self.received.update(forces=m), SENSOR)
        orders = self.listener.create_publisher(String, f"virtual/{what}", COMMAND)
        here = {"truth/tip", "forces"}
        self.until(lambda: orders.get_subscription_count() == 1 and here <= set(self.received), f"no virtual/{what}")
        return orders

    def until(self, condition, what):
        deadline = time.monotonic() + 120.0
        while not condition():
            assert time.monotonic() < deadline, what
            self.executor.spin_once(timeout_sec=0.05)

    def __exit__(self, *_):
        if self.node is not None:
            self.node.shut_down()
            self.node.destroy_node()
        rclpy.try_shutdown()


def test_truth_is_published_in_the_base_frame_with_one_stamp():
    with Graph("inclination_deg:=45.0") as graph:
        graph.start()
        graph.until(lambda: len(graph.received) == 3, "no ground truth")
        tip, gravity = graph.received["truth/tip"], graph.received["truth/gravity"].vector
        assert {m.header.frame_id for m in graph.received.values()} == {"soft_base"}
        np.testing.assert_allclose([gravity.x, gravity.y, gravity.z], [-9.80665 / 2**0.5, 0.0, -9.80665 / 2**0.5], atol=1e-6)
        assert len(graph.received["truth/backbone"].poses) == 11
        assert 0.09 < tip.pose.position.z < 0.101 and tip.pose.position.x < 0.0


@pytest.mark.parametrize("parameters", [("motion:=topic",), ("motion:=tilt", "hold:=0.0", "steerable:=true")])
def test_the_base_follows_its_topic(parameters):
    with Graph(*parameters) as graph:
        graph.start()
        publisher = graph.listener.create_publisher(QuaternionStamped, "virtual/base_orientation", COMMAND)
        upright = QuaternionStamped()
        upright.quaternion.w = 1.0

        def points_up():
            publisher.publish(upright)
            return "truth/gravity" in graph.received and graph.received["truth/gravity"].vector.z < -9.8

        graph.until(points_up, "the base does not turn")


def test_a_base_that_is_not_steerable_has_no_subscription():
    with Graph("motion:=tilt") as graph:
        graph.start()
        publisher = graph.listener.create_publisher(QuaternionStamped, "virtual/base_orientation", COMMAND)
        fault = graph.listener.create_publisher(String, "virtual/fault", 20)
        graph.until(lambda: fault.get_subscription_count() == 1, "the node does not subscribe to virtual/fault")
        assert publisher.get_subscription_count() == 0


def test_faults_begin_and_end_and_wrong_ones_are_refused(monkeypatch):
    with Graph() as graph:
        graph.start()
        publisher = graph.listener.create_publisher(String, "virtual/fault", 20)
        graph.until(lambda: publisher.get_subscription_count() == 1, "the node does not subscribe to virtual/fault")
        robot, refused = graph.node._live.robot, []
        monkeypatch.setattr(graph.node, "get_logger", lambda: SimpleNamespace(error=refused.append, info=len))
        publisher.publish(String(data="{kind: imu_stuck}"))
        graph.until(lambda: [f.kind for f in robot.faults] == ["imu_stuck"], "the fault does not begin")
        for bad in ("{kind: explode}", "{kind: [", "7", "{kind: stall, cable: s9}"):
            publisher.publish(String(data=bad))
        publisher.publish(String(data="clear"))
        graph.until(lambda: robot.faults == (), "the faults do not end")
        assert len(refused) == 4 and not any("\n" in sentence for sentence in refused)
        assert refused[1].startswith("virtual/fault, line 1, column 9: expected the node content")


def test_a_hand_pulls_the_tip_until_it_lets_go_or_is_not_heard_of():
    with Graph() as graph:
        hand = graph.bystander("hand")
        rest = height(graph)

        def pulled():
            hand.publish(String(data="{place_mm: [30, 0, 95]}"))
            return height(graph) > rest + 0.005 and "hand" in graph.received["forces"].source

        graph.until(pulled, "the hand does not pull")
        for bad in ("{place_mm: [1, 2]}", "{place_mm: [.nan, 0, 0]}", "[", "7"):
            hand.publish(String(data=bad))
        graph.until(pulled, "a wrong order has ended the pull")
        hand.publish(String(data="release"))
        graph.until(lambda: "hand" not in graph.received["forces"].source, "the hand does not let go")
        graph.until(lambda: height(graph) < rest + 0.001, "the tip does not come back")
        graph.until(pulled, "the hand does not pull again")
        graph.until(lambda: "hand" not in graph.received["forces"].source, "a hand that is not heard of does not let go")


def test_a_wall_can_be_put_next_to_the_robot_and_taken_away():
    with Graph() as graph:
        wall = graph.bystander("wall")
        below = 1e3 * height(graph) + 1.0  # the robot's radius is 4.5 mm
        wall.publish(String(data=f"{{name: slab, normal: [1, 0, 0], point_mm: [{below}, 0, 0]}}"))
        graph.until(lambda: graph.received["forces"].source[:1] == ["slab"], "the wall does not push")
        message = graph.received["forces"]
        assert message.has_wall and message.wall_normal.x == 1.0 and message.force[0].x > 0.0
        wall.publish(String(data="{normal: [1, 0, 0], point_mm: [0, 0, 0]}"))  # through the base: refused
        wall.publish(String(data="clear"))
        graph.until(lambda: not graph.received["forces"].has_wall and not graph.received["forces"].source, "the wall stays")


def height(graph):
    return graph.received["truth/tip"].pose.position.x


@pytest.mark.parametrize(
    ("parameter", "words"),
    [
        ("motion:=dance", "allowed: one of static"),
        ("motion:=recording", "'recording' is empty"),
        ("inclination_deg:=400.0", "allowed: -180 to 180 deg"),
        ("interface:=nosuch", "nosuch"),
        ("tilt:=3", "unknown parameter 'tilt'"),
    ],
)
def test_bad_parameters_are_refused_with_a_sentence(parameter, words):
    with Graph(parameter) as graph, pytest.raises(ConfigError, match=words):
        graph.start()


def test_an_unreadable_recording_is_refused_with_a_sentence(tmp_path):
    with (
        Graph("motion:=recording", f"recording:={tmp_path / 'none.npz'}") as graph,
        pytest.raises(ConfigError, match="does not exist"),
    ):
        graph.start()


def test_it_can_be_deactivated_and_activated_again():
    with Graph() as graph:
        graph.start()
        graph.until(lambda: len(graph.received) == 3, "no ground truth")
        graph.node.trigger_deactivate()
        assert not graph.node._live.link.is_open
        graph.received.clear()
        graph.node.trigger_activate()
        graph.until(lambda: len(graph.received) == 3, "no ground truth after the second activation")
