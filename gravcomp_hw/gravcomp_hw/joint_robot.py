"""The node joint_robot: a stand-in for a ros2_control robot, for the virtual robot and for tests.

It offers what joint_bridge uses of ros2_control: the topic of a joint_trajectory_controller or a forward_command_controller, and
joint_states. The motors of the virtual robot are behind it, as servos on its CAN bus, or mock joints. It also publishes the IMU
of the virtual robot, as the driver of an IMU would.
"""

import sys

from gravcomp_node.managed_node import ERROR, OK
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState as JointStateMessage
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory

from gravcomp.canbus.bus import BusError
from gravcomp.config import ConfigError
from gravcomp.graph.parameters.joint_robot import JointRobotParameters
from gravcomp.virtual.joint_controller import TrajectoryPoint
from gravcomp.virtual.joint_robot import JointRobot
from gravcomp.virtual.joint_servos import JointState
from gravcomp_hw.bridge_topics import ImuTopics, to_time
from gravcomp_node import ManagedNode, run

_MESSAGES = QoSProfile(depth=10)


class JointRobotNode(ManagedNode):
    """Stands in for the controllers and the hardware of a ros2_control robot."""

    name = "joint_robot"
    parameters_class = JointRobotParameters

    def configure(self) -> None:
        """Create publishers and joints. Raises ConfigError when the hardware section is not usable."""
        file, p = self.robot_file, self.parameters
        hardware = file.hardware
        if hardware.joints is None:
            raise ConfigError(
                f"{file.source}: key 'hardware.joints' is missing (the controller and the joints that wind the cables)"
            )
        self._topic, self._kind = hardware.joints.topic, hardware.joints.command
        try:
            self._robot = JointRobot(
                hardware.on(p.interface, p.channel), p.update_rate, self._publish, lambda sample: self._imu.publish(sample),
                mock=p.joints == "mock",
            )  # fmt: skip
        except ValueError as error:
            raise ConfigError(f"{file.source}: {error}") from error
        self._states = self.create_publisher(JointStateMessage, "joint_states", _MESSAGES)
        self._imu = ImuTopics(self, p.imu_frame)
        self._refusal = ""

    def activate(self) -> None:
        """Join the bus and take commands. Raises ConfigError when the bus cannot be opened."""
        try:
            self._robot.start()
        except BusError as error:
            raise ConfigError(str(error)) from error
        if self._kind == "trajectory":
            self._commands = self.create_subscription(JointTrajectory, self._topic, self._on_trajectory, _MESSAGES)
        else:
            self._commands = self.create_subscription(Float64MultiArray, self._topic, self._on_values, _MESSAGES)
        self._timer = self.create_timer(0.5, self._diagnose)

    def deactivate(self) -> None:
        """Leave the bus."""
        self.destroy_timer(self._timer)
        self.destroy_subscription(self._commands)
        self._robot.stop()

    def cleanup(self) -> None:
        """Destroy the publishers."""
        if hasattr(self, "_states"):
            self.destroy_publisher(self._states)
            self._imu.destroy()
            del self._states

    def _publish(self, state: JointState) -> None:
        message = JointStateMessage(name=self._robot.names, position=state.angles, velocity=state.speeds, effort=state.efforts)
        message.header.stamp = to_time(self.get_clock().now().nanoseconds)
        self._states.publish(message)

    def _on_trajectory(self, message: JointTrajectory) -> None:
        points = [
            TrajectoryPoint(p.positions, p.velocities, p.time_from_start.sec + 1e-9 * p.time_from_start.nanosec)
            for p in message.points
        ]
        stamp = message.header.stamp
        start = stamp.sec + 1e-9 * stamp.nanosec
        self._note(self._robot.on_trajectory(message.joint_names, points, start or None))

    def _on_values(self, message: Float64MultiArray) -> None:
        self._note(self._robot.on_values(message.data))

    def _note(self, refusal: str | None) -> None:
        if refusal and refusal != self._refusal:
            self.get_logger().error(f"{self._topic}: {refusal}")
        self._refusal = refusal or self._refusal

    def _diagnose(self) -> None:
        robot = self._robot
        if robot.error is not None:
            self.get_logger().fatal(f"the joints have stopped: {robot.error!r}")
            self.report(ERROR, f"stopped: {robot.error!r}")
            self.finished = True
            return
        self.report(
            OK,
            f"takes {self._topic}",
            accepted=robot.controller.accepted,
            refused=robot.controller.refused,
            refusal=self._refusal,
        )


def main() -> int:
    """Run the node; return the exit code."""
    return run(JointRobotNode)


if __name__ == "__main__":
    sys.exit(main())
