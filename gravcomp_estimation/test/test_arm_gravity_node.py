"""arm_gravity as processes: two robots on two arms in one graph, fused gravity, and what is missing in joint_states."""

import os
import signal
import subprocess
import sys
import time

os.environ.setdefault("ROS_DOMAIN_ID", str(100 + os.getpid() % 100))

import numpy as np
import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Vector3Stamped
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from gravcomp.arm.chain import Chain, angle_between
from gravcomp_node import LATCHED, SENSOR

signal.signal(signal.SIGHUP, signal.SIG_DFL)

ARM = """<joint name="{0}_mount" type="fixed">
    <parent link="world"/><child link="{0}_a"/><origin xyz="0 {1} 0" rpy="{1} 0 0"/>
</joint>
<link name="{0}_a"/><link name="{0}_b"/><link name="{0}_soft_base"/>
<joint name="{0}_j1" type="revolute"><parent link="{0}_a"/><child link="{0}_b"/><axis xyz="0 1 0"/></joint>
<joint name="{0}_j2" type="revolute"><parent link="{0}_b"/><child link="{0}_soft_base"/><axis xyz="1 0 0"/></joint>"""
URDF = '<robot name="two"><link name="world"/>' + ARM.format("left", 0.5) + ARM.format("right", -0.5) + "</robot>"
JOINTS = {"left_j1": 0.3, "left_j2": -0.7, "right_j1": 1.1, "right_j2": 0.2}


class Bench:
    """A listener and publisher, and the nodes that a test starts."""

    def __init__(self, urdf: str):
        self.urdf, self.processes, self.heard, self.sentences = urdf, [], {}, {}
        rclpy.init()
        self.node = rclpy.create_node("arms")
        self.joints = self.node.create_publisher(JointState, "/joint_states", 10)
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self.on_diagnostics, 10)

    def start(self, side: str, *parameters: str, topic: str) -> None:
        options = ["-r", f"__ns:=/{side}", "-r", "joint_states:=/joint_states"]
        options += ["-p", f"urdf:={self.urdf}"] if self.urdf else []
        options += ["-p", f"base_frame:={side}_soft_base", *(part for p in parameters for part in ("-p", p))]
        self.processes.append(subprocess.Popen([sys.executable, "-m", "gravcomp_estimation.arm_gravity", "--ros-args", *options]))
        name = f"/{side}/{topic}"
        self.node.create_subscription(Vector3Stamped, name, lambda m: self.heard.update({name: m}), SENSOR)

    def on_diagnostics(self, message):
        self.sentences.update({status.name: status.message for status in message.status})

    def until(self, condition, what, names=JOINTS, each=lambda: None):
        deadline = time.monotonic() + 30.0
        while not condition():
            assert time.monotonic() < deadline, f"{what}: {self.sentences}"
            message = JointState(name=list(names), position=[JOINTS[name] for name in names])
            message.header.stamp = self.node.get_clock().now().to_msg()
            self.joints.publish(message)
            each()
            rclpy.spin_once(self.node, timeout_sec=0.01)

    def gravity(self, topic: str) -> np.ndarray:
        v = self.heard[topic].vector
        return np.array([v.x, v.y, v.z])

    def close(self):
        for process in self.processes:
            process.kill()
            process.wait()
        self.node.destroy_node()
        rclpy.try_shutdown()


@pytest.fixture
def bench(tmp_path):
    urdf = tmp_path / "two.urdf"
    urdf.write_text(URDF, encoding="utf-8")
    bench = Bench(str(urdf))
    yield bench
    bench.close()


def test_two_robots_on_two_arms_each_have_their_gravity(bench):
    """Both arms in one joint_states; the left robot fuses, the right one has no IMU."""
    bench.start("left", "use:=fuse", "imu_std_deg:=1.0", "arm_std_deg:=0.5", topic="gravity")
    bench.start("right", "use:=publish", topic="gravity")
    expected = {side: Chain(URDF, f"{side}_soft_base", "world").gravity(JOINTS) for side in ("left", "right")}
    bench.until(lambda: {"/left/gravity", "/right/gravity"} <= set(bench.heard), "no gravity")
    for side, gravity in expected.items():
        assert angle_between(bench.gravity(f"/{side}/gravity"), gravity) < 1e-9

    # With an IMU that is off by 0.02 rad the fused gravity is off by a fifth of it.
    imu = bench.node.create_publisher(Vector3Stamped, "/left/gravity/imu", SENSOR)
    axis = np.cross(expected["left"], [0.3, 0.4, 0.5])
    off = expected["left"] + 0.02 * axis / np.linalg.norm(axis) * np.linalg.norm(expected["left"])

    def publish():
        message = Vector3Stamped()
        message.header.stamp.sec = 77
        message.vector.x, message.vector.y, message.vector.z = off.tolist()
        imu.publish(message)

    def fused():
        message = bench.heard["/left/gravity"]
        return message.header.stamp.sec == 77 and angle_between(bench.gravity("/left/gravity"), expected["left"]) < 0.0045

    bench.until(fused, "not fused", each=publish)


def test_missing_joints_are_named(bench):
    bench.start("left", "use:=publish", topic="gravity")
    wanted = "joint_states does not bring left_j2; it has right_j1, right_j2: is a prefix missing?"
    names = ["right_j1", "left_j1", "right_j2"]
    bench.until(lambda: bench.sentences.get("/left/arm_gravity") == wanted, "not named", names=names)


def test_a_description_that_is_refused_is_named(bench):
    bench.urdf = ""
    bench.start("left", "use:=publish", topic="gravity")
    publisher = bench.node.create_publisher(String, "/left/robot_description", LATCHED)
    publisher.publish(String(data=URDF.replace('<parent link="world"/>', '<parent link="left_b"/>', 1)))
    wanted = "robot_description: the links left_a, left_b are a loop; a URDF is a tree"
    bench.until(lambda: bench.sentences.get("/left/arm_gravity") == wanted, "not named")


def test_the_acceleration_comes_with_a_urdf_file(bench):
    bench.start("left", "feed_acceleration:=true", topic="arm/acceleration")
    bench.until(lambda: "/left/arm/acceleration" in bench.heard, "no acceleration")
    assert np.abs(bench.gravity("/left/arm/acceleration")).max() < 1e-6  # the arm is at rest
