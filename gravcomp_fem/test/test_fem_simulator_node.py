"""The simulator adds the forces of the base's turn to gravity, from the rate in imu/data, and only while that arrives."""

import os
import time

os.environ.setdefault("ROS_DOMAIN_ID", str(100 + os.getpid() % 100))

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import Vector3Stamped
from gravcomp_fem.conversion import vector_of
from gravcomp_fem.fem_simulator import FemSimulator
from rclpy.executors import SingleThreadedExecutor
from rclpy.time import Time
from sensor_msgs.msg import Imu

from gravcomp.launcher.model_builder import MARK
from gravcomp_msgs.msg import Deformation
from gravcomp_node import SENSOR

GRAVITY = np.array([-9.81, 0.0, 0.0])
CHANGE = 2.0  # rad/s^2 about x of soft_base
PERIOD_NS = 10_000_000


class Stand:
    """The simulator, and what it receives. shapes: gravity of each deformation, and what the turn adds to it."""

    def __init__(self):
        rclpy.init(args=["test"])
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
