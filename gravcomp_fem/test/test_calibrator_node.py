"""The calibrator pulls no cable before the controller has stopped, and ends when its measurements are in the file."""

import os
import time

os.environ.setdefault("ROS_DOMAIN_ID", str(100 + os.getpid() % 100))

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import PoseStamped, Vector3Stamped
from gravcomp_fem.calibrator import Calibrator
from rclpy.executors import SingleThreadedExecutor
from rclpy.time import Time
from sensor_msgs.msg import Imu
from std_srvs.srv import SetBool

from gravcomp.calibration.files import read_measured
from gravcomp.calibration.plan import Plan, PlannedPose, gravity_of
from gravcomp.calibration.plan_file import save_plan
from gravcomp_msgs.msg import CableCommand, CableState
from gravcomp_node import COMMAND, SENSOR

PULL = np.array([1e-3, -5e-3, -5e-3, -5e-3, -5e-3, -5e-3])


class Stand:
    """The calibrator and what it needs: a controller that first refuses to stop, gravity, cables and a tracker.

    heard: the displacements that were commanded; asked: what the controller was asked; willing: whether it stops.
    """

    def __init__(self, folder):
        plan = Plan((PlannedPose(0.0, 0.0, PULL, ("s1c1",), np.zeros(6), np.zeros(3)),), (1.0,), 0.3, 1.0)
        save_plan(plan, folder / "plan.json")
        self.out = folder / "live.csv"
        parameters = {"plan": folder / "plan.json", "out": self.out}
        rclpy.init(args=["test", "--ros-args", *(a for name, path in parameters.items() for a in ("-p", f"{name}:={path}"))])
        self.executor, self.calibrator = SingleThreadedExecutor(), Calibrator()
        self.other = rclpy.create_node("other", use_global_arguments=False)
        self.heard: list[np.ndarray] = []
        self.asked: list[bool] = []
        self.willing, self.time = False, 1000.0
        self.other.create_service(SetBool, "inverse_controller/enable", self._answer)
        self.other.create_subscription(
            CableCommand, "cable/command", lambda m: self.heard.append(np.array(m.displacement)), COMMAND
        )
        self.gravity = self.other.create_publisher(Vector3Stamped, "gravity", SENSOR)
        self.state = self.other.create_publisher(CableState, "cable/state", SENSOR)
        self.tip = self.other.create_publisher(PoseStamped, "measured/tip", SENSOR)
        self.imu = self.other.create_publisher(Imu, "imu/data", SENSOR)
        for node in (self.calibrator, self.other):
            self.executor.add_node(node)
        self.calibrator.start()

    def _answer(self, request, answer):
        self.asked.append(request.data)
        answer.success, answer.message = self.willing, "" if self.willing else "not now"
        return answer

    def publish(self):
        """Publish 20 ms of the robot's time."""
        self.time += 0.02
        stamp = Time(seconds=self.time).to_msg()
        gravity, tip = Vector3Stamped(), PoseStamped()
        gravity.vector.x, gravity.vector.y, gravity.vector.z = gravity_of(0.0, 0.0)
        tip.pose.position.z = 0.1
        imu = Imu()
        imu.linear_acceleration.x, imu.linear_acceleration.z = 6.0, 7.0
        gravity.header.stamp = tip.header.stamp = imu.header.stamp = stamp
        self.imu.publish(imu)
        self.state.publish(CableState(displacement=[0.0] * 6))
        self.gravity.publish(gravity)
        self.tip.publish(tip)

    def until(self, done, what):
        end = time.monotonic() + 60.0
        while not done():
            assert time.monotonic() < end, what
            self.publish()
            self.executor.spin_once(timeout_sec=0.01)

    def close(self):
        self.calibrator.shut_down()
        self.calibrator.destroy_node()
        self.other.destroy_node()
        rclpy.shutdown()


@pytest.fixture
def stand(tmp_path):
    stand = Stand(tmp_path)
    yield stand
    stand.close()


def test_the_cables_wait_for_the_controllers_answer(stand):
    stand.until(lambda: len(stand.asked) > 1, "it does not ask again after a refusal")
    assert stand.asked == [False, False] and stand.heard == [] and "does not stop: not now" in stand.calibrator._shown
    stand.willing = True
    stand.until(lambda: stand.calibrator.finished, "it does not end")
    assert np.abs(stand.heard[-1] - PULL).max() < 1e-6
    assert stand.out.read_text(encoding="utf-8").startswith("pose,trial,time_s")
    assert read_measured(stand.out, stand.calibrator.robot_file.robot.cable_names).specific_force[-1] == pytest.approx(9.2195)
