"""The nodes joint_bridge and joint_robot as processes: the cables follow commands, what is missing is named."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

os.environ.setdefault("ROS_DOMAIN_ID", str(100 + os.getpid() % 100))

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from gravcomp_hw.joint_guard_client import JointGuardClient
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory

from gravcomp.motors.guard_protocol import ANSWER_TIMEOUT
from gravcomp_msgs.msg import CableCommand, CableState
from gravcomp_node import COMMAND

signal.signal(signal.SIGHUP, signal.SIG_DFL)

ROBOT = Path(__file__).resolve().parents[2] / "src" / "examples" / "joint_robot.yaml"
GOAL = [0.002, -0.001, 0.003, -0.002]  # m
RADII = [0.006, 0.006, 0.008]  # m, of the joints with round capstans


class Bench:
    """Both processes, a controller of cables and a listener."""

    def __init__(self):
        self.processes = [self.start("joint_bridge"), self.start("joint_robot", "-p", "joints:=mock")]
        rclpy.init()
        self.node = rclpy.create_node("listener")
        self.heard, self.sentences, self.trajectory_names = {}, set(), None
        for kind, topic, qos in ((CableState, "cable/state", COMMAND), (JointState, "joint_states", 10)):
            self.node.create_subscription(kind, topic, lambda m, t=topic: self.heard.update({t: m}), qos)
        self.node.create_subscription(JointTrajectory, "cable_controller/joint_trajectory", self.on_trajectory, 10)
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self.on_diagnostics, 10)
        self.commands = self.node.create_publisher(CableCommand, "cable/command", COMMAND)

    @staticmethod
    def start(executable: str, *more: str) -> subprocess.Popen:
        options = ["--ros-args", "-p", f"robot:={ROBOT}", *more]
        return subprocess.Popen([sys.executable, "-m", f"gravcomp_hw.{executable}", *options])

    def on_trajectory(self, message):
        self.trajectory_names = list(message.joint_names)

    def on_diagnostics(self, message):
        self.sentences.update(status.message for status in message.status if "joint_bridge" in status.name)

    def until(self, condition, what):
        deadline = time.monotonic() + 30.0
        while not condition():
            assert time.monotonic() < deadline, what
            self.commands.publish(CableCommand(displacement=GOAL))
            rclpy.spin_once(self.node, timeout_sec=0.01)

    def state(self):
        state = self.heard.get("cable/state")
        return None if state is None else state.state

    def close(self):
        for process in self.processes:
            process.kill()
            process.wait()
        self.node.destroy_node()
        rclpy.try_shutdown()


@pytest.fixture
def bench():
    bench = Bench()
    yield bench
    bench.close()


def test_the_joints_of_a_ros2_control_robot_wind_the_cables(bench):
    bench.until(lambda: bench.state() == CableState.ACTIVE, "the bridge does not follow")
    assert bench.trajectory_names == ["motor_1", "motor_2", "motor_3", "motor_4"]

    def arrived():
        return max(abs(x - y) for x, y in zip(bench.heard["cable/state"].displacement, GOAL)) < 1e-6

    bench.until(arrived, "the cables do not arrive")
    directions, zeros = (1, -1, 1), (0.0, 1.5707963, 0.0)

    def wound():
        angles = bench.heard["joint_states"].position
        parts = zip(angles, directions, zeros, RADII, GOAL)
        return all(abs(direction * (angle - zero) * radius - goal) < 1e-6 for angle, direction, zero, radius, goal in parts)

    # The message of the joints may be older than that of the cables.
    bench.until(wound, "the joints are not where the cables are")

    client = bench.node.create_client(Trigger, "joint_bridge/stop")
    assert client.wait_for_service(10.0)
    answer = client.call_async(Trigger.Request())
    bench.until(answer.done, "stop is not answered")
    assert answer.result().success and "~/resume" in answer.result().message
    bench.until(lambda: bench.state() == CableState.STOPPED, "the bridge does not stop")

    bench.processes[1].kill()  # without the robot the bridge cannot resume
    client = bench.node.create_client(Trigger, "joint_bridge/resume")
    assert client.wait_for_service(10.0)
    bench.processes[1].wait()
    answered = []

    def refused():
        if not answered or answered[-1].done():
            if answered and not answered[-1].result().success:
                return True
            answered.append(client.call_async(Trigger.Request()))
        return False

    bench.until(refused, "the bridge resumes without joints")
    assert "joint_states" in answered[-1].result().message or "cable_controller" in answered[-1].result().message


def test_a_killed_bridge_leaves_no_effort(tmp_path):
    robot = tmp_path / "effort.yaml"
    robot.write_text(ROBOT.read_text(encoding="utf-8").replace("command: trajectory", "command: effort"), encoding="utf-8")
    bridge = subprocess.Popen(
        [sys.executable, "-m", "gravcomp_hw.joint_bridge", "--ros-args", "-p", f"robot:={robot}", "-r", "__ns:=/alone"]
    )
    rclpy.init()
    node, sent = rclpy.create_node("controller"), []
    node.create_subscription(Float64MultiArray, "/alone/cable_controller/commands", lambda m: sent.append(list(m.data)), 10)
    states = node.create_publisher(JointState, "/alone/joint_states", 10)
    commands = node.create_publisher(CableCommand, "/alone/cable/command", COMMAND)
    names = [f"motor_{i}" for i in range(1, 5)]

    def until(condition, what):
        deadline = time.monotonic() + 30.0
        while not condition():
            assert time.monotonic() < deadline, what
            states.publish(JointState(name=names, position=[0.0, 1.5707963, 0.0, 0.0], velocity=[0.0] * 4))
            commands.publish(CableCommand(displacement=[0.001] * 4, tension=[0.3] * 4))
            rclpy.spin_once(node, timeout_sec=0.01)

    try:
        until(lambda: sent and any(sent[-1]), "no effort is sent")
        bridge.kill()
        bridge.wait()
        until(lambda: sent[-1] == [0.0] * 4, "the efforts stay")
    finally:
        bridge.kill()
        node.destroy_node()
        rclpy.try_shutdown()


def test_a_guard_that_hangs_is_found_and_replaced():
    guard = JointGuardClient("/alone/commands", 3, "/alone")
    try:
        assert beats(guard, 0.2)
        time.sleep(ANSWER_TIMEOUT + 0.2)  # a bridge that has hung itself does not take the guard for one that hangs
        assert beats(guard, 0.2)
        first = guard.pid
        os.kill(first, signal.SIGSTOP)
        begin = time.monotonic()
        assert not beats(guard, ANSWER_TIMEOUT + 2.0)
        assert time.monotonic() - begin < ANSWER_TIMEOUT + 1.0
        while Path(f"/proc/{first}").exists() or not guard.beat():
            assert time.monotonic() - begin < 30.0
            time.sleep(0.01)
        assert guard.pid != first and beats(guard, 0.2)
    finally:
        guard.close()


def beats(guard, duration):
    """Send heartbeats; return whether all were taken."""
    end = time.monotonic() + duration
    while time.monotonic() < end:
        if not guard.beat():
            return False
        time.sleep(0.004)
    return True


def test_a_robot_without_joints_is_refused():
    started = subprocess.run(
        [sys.executable, "-m", "gravcomp_hw.joint_bridge", "--ros-args", "-p", "robot:=article"],
        capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert started.returncode == 2 and "key 'hardware.joints' is missing" in started.stderr
