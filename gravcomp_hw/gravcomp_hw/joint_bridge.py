"""The node joint_bridge: topics and services around gravcomp.motors.joint_driver.JointDriver.

It drives the cables through the controller of a ros2_control robot. The control runs in a thread of the driver, so that a slow
middleware delays it no more than one message does.
"""

import array
import math
import sys
import time
from collections.abc import Sequence

from builtin_interfaces.msg import Duration
from gravcomp_node.managed_node import OK, WARN
from rclpy.qos import QoSProfile
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from gravcomp.config import ConfigError
from gravcomp.description.hardware import Hardware
from gravcomp.description.joint_motors import Joints
from gravcomp.graph.parameters.joint_bridge import JointBridgeParameters
from gravcomp.motors.joint_driver import JointDriver, JointDriverOptions
from gravcomp.motors.state import CableSnapshot
from gravcomp_hw.bridge_topics import cable_state, level, subscribe_command, trigger
from gravcomp_hw.joint_guard_client import JointGuardClient, JointGuardError
from gravcomp_msgs.msg import CableState
from gravcomp_node import COMMAND, SENSOR, ManagedNode, run

_STATES = QoSProfile(depth=10)
_LOOK_PERIOD = 0.1  # s, between two looks whether somebody takes the commands


class JointBridgeNode(ManagedNode):
    """Drives the cables through the joints of a ros2_control robot; publishes the state of the cables."""

    name = "joint_bridge"
    parameters_class = JointBridgeParameters

    def configure(self) -> None:
        """Create publishers and driver. Raises ConfigError when the hardware section is not usable."""
        p = self.parameters
        self._joints, hardware = self._read_hardware()
        self._names = [motor.joint for motor in self._joints.motors]
        self._horizon = Duration(nanosec=round(1e9 * p.horizon))
        kind = JointTrajectory if self._joints.command == "trajectory" else Float64MultiArray
        self._commands = self.create_publisher(kind, self._joints.topic, _STATES)
        self._state = self.create_publisher(CableState, "cable/state", COMMAND)
        self._logged = ""
        self._looked, self._controller_missing = -math.inf, None
        self._publishing = False
        options = JointDriverOptions(p.control_rate, p.state_rate, p.require_imu)
        self._guard: JointGuardClient | None = None
        if p.guard and self._joints.command == "effort":
            try:
                # The resolved name: a remapping of the bridge holds for its guard as well.
                self._guard = JointGuardClient(self._commands.topic_name, len(self._names), self.get_namespace())
            except JointGuardError as error:
                raise ConfigError(str(error)) from error
        beat = self._guard.beat if self._guard is not None else lambda: True
        self._driver = JointDriver(hardware, options, self._send, self._publish_state, self._missing_controller, beat)
        self._driver.open()

    def activate(self) -> None:
        """Start driving."""
        self._driver.activate()
        self._publishing = True
        request = self._driver.request
        self._subscriptions_here = [
            self.create_subscription(JointState, "joint_states", self._on_joint_states, _STATES),
            subscribe_command(self, self._driver.command),
        ]
        if self.parameters.require_imu:
            self._subscriptions_here.append(self.create_subscription(Imu, "imu/data_raw", self._on_imu, SENSOR))
        self._services_here = [
            self.create_service(Trigger, "~/stop", trigger(request, lambda bridge, now: bridge.stop())),
            self.create_service(Trigger, "~/release", trigger(request, lambda bridge, now: bridge.release(now))),
            self.create_service(Trigger, "~/resume", trigger(request, lambda bridge, now: bridge.resume(now))),
        ]
        self._timer = self.create_timer(0.5, self._diagnose)

    def deactivate(self) -> None:
        """Stop driving and publishing; a controller of efforts is sent zeros."""
        self._driver.deactivate()
        self._publishing = False
        for subscription in self._subscriptions_here:
            self.destroy_subscription(subscription)
        for service in self._services_here:
            self.destroy_service(service)
        self.destroy_timer(self._timer)

    def cleanup(self) -> None:
        """End the driver."""
        driver = getattr(self, "_driver", None)
        if driver is None:
            return
        driver.close()
        if self._guard is not None:
            self._guard.close()
        for publisher in (self._commands, self._state):
            self.destroy_publisher(publisher)
        self._driver = None

    def _read_hardware(self) -> tuple[Joints, Hardware]:
        file = self.robot_file
        hardware = file.hardware
        if hardware.joints is None:
            raise ConfigError(
                f"{file.source}: key 'hardware.joints' is missing (the controller and the joints that wind the cables)"
            )
        return hardware.joints, hardware

    def _missing_controller(self) -> str | None:
        now = time.monotonic()
        if now - self._looked > _LOOK_PERIOD:
            self._looked = now
            taken = self._commands.get_subscription_count() > 0
            topic = self._joints.topic
            self._controller_missing = None if taken else f"nobody takes {topic}: is the controller loaded, and its name right?"
        return self._controller_missing

    def _send(self, values: Sequence[float]) -> None:
        if self._joints.command == "trajectory":
            # Without a stamp it begins when it arrives. Positions only: a last point with a velocity is refused.
            point = JointTrajectoryPoint(positions=array.array("d", values), time_from_start=self._horizon)
            self._commands.publish(JointTrajectory(joint_names=self._names, points=[point]))
        else:
            self._commands.publish(Float64MultiArray(data=array.array("d", values)))

    def _on_joint_states(self, message: JointState) -> None:
        stamp = message.header.stamp
        self._driver.on_joint_states(
            message.name, message.position, message.velocity, message.effort, stamp.sec * 10**9 + stamp.nanosec
        )

    def _on_imu(self, _: Imu) -> None:
        self._driver.bridge.on_imu_sample(time.monotonic())

    def _publish_state(self, snapshot: CableSnapshot) -> None:
        if self._publishing:
            self._state.publish(cable_state(snapshot, self.get_clock().now().nanoseconds))

    def _diagnose(self) -> None:
        driver = self._driver
        snapshot = driver.snapshot()
        severity, state = level(snapshot.state), f"{snapshot.state.name.lower()}: "
        sentence = state + snapshot.message.removeprefix(state)
        zeros = (
            f"{motor.joint} {math.degrees(scale.zero):.2f}"
            for motor, scale in zip(self._joints.motors, driver.bridge.joints.scales)
            if scale.zero is not None
        )
        loop = driver.bridge.loop_delay
        self.report(
            severity,
            sentence,
            controller=self._joints.topic,
            zero_deg=", ".join(zeros),
            joint_states_rejected=driver.bridge.joints.rejected,
            commands_refused=driver.bridge.refused_commands,
            control_overruns=driver.overruns,
            command_delay_ms=round(1e3 * driver.delay, 2),
            **({} if loop is None else {"loop_delay_ms": round(1e3 * loop, 1)}),
        )
        if sentence != self._logged:
            self._logged = sentence
            if severity in (OK, WARN):
                self.get_logger().info(sentence)
            else:
                self.get_logger().warning(sentence)


def main() -> int:
    """Run the node; return the exit code."""
    return run(JointBridgeNode)


if __name__ == "__main__":
    sys.exit(main())
