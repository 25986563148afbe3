"""The node can_bridge: topics and services around gravcomp.motors.driver.BridgeDriver.

A separate thread publishes the samples and states from the driver's queue, so that a slow middleware delays neither the control
(a thread of the driver) nor the commands (the executor).
"""

import sys
import threading

from gravcomp_node.managed_node import OK, WARN
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Float32
from std_srvs.srv import Trigger

from gravcomp.canbus.bus import BusError
from gravcomp.canbus.imu_stream import ImuSample
from gravcomp.config import ConfigError
from gravcomp.description.hardware import Hardware
from gravcomp.graph.parameters.can_bridge import CanBridgeParameters
from gravcomp.motors.driver import BridgeDriver, DriverOptions
from gravcomp.motors.guard_client import GuardError
from gravcomp.motors.state import CableSnapshot
from gravcomp_hw.bridge_topics import ImuTopics, cable_state, level, subscribe_command, trigger
from gravcomp_msgs.msg import CableState
from gravcomp_node import COMMAND, SENSOR, ManagedNode, run


class CanBridge(ManagedNode):
    """Drives the cables over CAN; publishes the IMU samples and the state of the cables."""

    name = "can_bridge"
    parameters_class = CanBridgeParameters

    def configure(self) -> None:
        """Open the bus and create the publishers. Raises ConfigError when the hardware section or the bus is not usable."""
        p = self.parameters
        self._hardware = self._read_hardware()
        self._driver = BridgeDriver(
            self._hardware, DriverOptions(p.control_rate, p.state_rate, p.zero, p.require_imu, p.guard, p.trace)
        )
        try:
            self._driver.open()
        except BusError as error:
            raise ConfigError(str(error)) from error
        self._imu = ImuTopics(self, p.imu_frame)
        self._state = self.create_publisher(CableState, "cable/state", COMMAND)
        self._joints = self.create_publisher(JointState, "joint_states", QoSProfile(depth=10))
        self._logged = ""
        self._publishing = False
        self._publisher = threading.Thread(target=self._publish, name="publisher", daemon=True)
        self._publisher.start()

    def activate(self) -> None:
        """Start driving. Raises ConfigError when the guard process cannot be started."""
        try:
            self._driver.activate()
        except GuardError as error:
            raise ConfigError(str(error)) from error
        self._publishing = True
        self._active_entities = [
            subscribe_command(self, self._driver.command),
            # A best-effort subscription also receives from reliable publishers.
            self.create_subscription(Float32, "imu/heater", lambda m: self._driver.heater(m.data), SENSOR),
            self.create_service(Trigger, "~/home", trigger(self._driver.request, lambda bridge, now: bridge.home(now))),
            self.create_service(Trigger, "~/stop", trigger(self._driver.request, lambda bridge, now: bridge.stop())),
            self.create_service(Trigger, "~/release", trigger(self._driver.request, lambda bridge, now: bridge.release(now))),
            self.create_service(Trigger, "~/resume", trigger(self._driver.request, lambda bridge, now: bridge.resume(now))),
            self.create_timer(0.5, self._diagnose),
        ]

    def deactivate(self) -> None:
        """Set all currents to zero and stop publishing."""
        self._driver.deactivate()
        self._publishing = False
        subscriptions, services, timer = self._active_entities[:2], self._active_entities[2:-1], self._active_entities[-1]
        for subscription in subscriptions:
            self.destroy_subscription(subscription)
        for service in services:
            self.destroy_service(service)
        self.destroy_timer(timer)

    def cleanup(self) -> None:
        """Close the bus."""
        driver = getattr(self, "_driver", None)
        if driver is None:
            return
        driver.close()
        self._publisher.join(2.0)
        self._imu.destroy()
        for publisher in (self._state, self._joints):
            self.destroy_publisher(publisher)
        self._driver = None

    def _read_hardware(self) -> Hardware:
        """Return the section `hardware` with this node's interface and channels."""
        file, p = self.robot_file, self.parameters
        hardware = file.hardware
        hardware = hardware.on(p.interface, p.channel)
        for bus in hardware.all_buses:
            file.require_motors(bus.interface)
        return hardware

    def _publish(self) -> None:
        """Publish the entries of the driver's queue until the queue ends."""
        while (entry := self._driver.queue.get()) is not None:
            if not self._publishing:
                continue
            if isinstance(entry, ImuSample):
                self._imu.publish(entry)
            else:
                self._publish_state(entry)

    def _publish_state(self, snapshot: CableSnapshot) -> None:
        message = cable_state(snapshot, self.get_clock().now().nanoseconds)
        self._state.publish(message)
        if not self._joints.get_subscription_count():
            return
        joints = JointState(name=list(self._hardware.cables))
        joints.header.stamp = self.get_clock().now().to_msg()
        joints.position, joints.velocity, joints.effort = message.displacement, message.velocity, message.tension
        self._joints.publish(joints)

    def _diagnose(self) -> None:
        driver = self._driver
        snapshot, imu, link = driver.snapshot(), driver.imu.counters, driver.link.counters
        severity = level(snapshot.state)
        fault = driver.imu.fault
        state = f"{snapshot.state.name.lower()}: "
        sentence = state + snapshot.message.removeprefix(state) + (f"; {fault}" if fault else "")
        self.report(
            max(severity, WARN) if fault else severity,
            sentence,
            bus=driver.link.status,
            frames_received=link.received,
            frames_sent=link.sent,
            frames_rejected=driver.bridge.rejected_frames + imu.rejected,
            send_errors=link.send_errors,
            error_frames=link.error_frames,
            bus_lost=link.lost,
            imu_samples=imu.samples,
            imu_lost=imu.lost,
            imu_repeated=imu.repeated,
            board_restarts=imu.restarts,
            commands_refused=driver.bridge.refused_commands,
            control_overruns=driver.overruns,
            command_delay_ms=round(1e3 * driver.delay, 2),
        )
        if sentence != self._logged:
            self._logged = sentence
            if severity == OK and not fault:
                self.get_logger().info(sentence)
            else:
                self.get_logger().warning(sentence)


def main() -> int:
    """Run the node; return the exit code."""
    return run(CanBridge)


if __name__ == "__main__":
    sys.exit(main())
