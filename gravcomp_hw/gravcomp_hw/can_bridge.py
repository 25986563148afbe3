"""The node can_bridge: topics and services around gravcomp.motors.driver.BridgeDriver.

A separate thread publishes the samples and states from the driver's queue, so that a slow middleware delays neither the control
(a thread of the driver) nor the commands (the executor).
"""

import array
import math
import sys
import threading
import time
from collections.abc import Callable

from builtin_interfaces.msg import Time
from gravcomp_node.managed_node import ERROR, OK, WARN
from rclpy.qos import QoSProfile
from sensor_msgs.msg import Imu, JointState, Temperature
from std_msgs.msg import Float32
from std_srvs.srv import Trigger

from gravcomp.canbus.bus import BusError
from gravcomp.canbus.imu_stream import ImuSample
from gravcomp.config import ConfigError
from gravcomp.description.hardware import Hardware, parse_hardware
from gravcomp.description.pairs import check_pairs
from gravcomp.graph.parameters.can_bridge import CanBridgeParameters
from gravcomp.motors.bridge import Bridge
from gravcomp.motors.driver import BridgeDriver, DriverOptions
from gravcomp.motors.guard_client import GuardError
from gravcomp.motors.state import CableSnapshot, State
from gravcomp_msgs.msg import CableCommand, CableState
from gravcomp_node import COMMAND, SENSOR, ManagedNode, run

_TEMPERATURE_EVERY = 10  # samples; the chip updates its temperature every 1.28 s
_LEVELS = {State.ACTIVE: OK, State.HOLDING: OK, State.HOMING: OK, State.FAULT: ERROR}
_LOG_PERIOD = 1.0  # s, between two log messages about refused commands


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
        self._imu = self.create_publisher(Imu, "imu/data_raw", SENSOR)
        self._temperature = self.create_publisher(Temperature, "imu/temperature", SENSOR)
        self._state = self.create_publisher(CableState, "cable/state", COMMAND)
        self._joints = self.create_publisher(JointState, "joint_states", QoSProfile(depth=10))
        self._logged, self._refusal_logged = "", -math.inf
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
            self.create_subscription(CableCommand, "cable/command", self._command, COMMAND),
            # A best-effort subscription also receives from reliable publishers.
            self.create_subscription(Float32, "imu/heater", lambda m: self._driver.heater(m.data), SENSOR),
            self.create_service(Trigger, "~/home", self._trigger(lambda bridge, now: bridge.home(now))),
            self.create_service(Trigger, "~/stop", self._trigger(lambda bridge, now: bridge.stop())),
            self.create_service(Trigger, "~/release", self._trigger(lambda bridge, now: bridge.release(now))),
            self.create_service(Trigger, "~/resume", self._trigger(lambda bridge, now: bridge.resume(now))),
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
        for publisher in (self._imu, self._temperature, self._state, self._joints):
            self.destroy_publisher(publisher)
        self._driver = None

    def _read_hardware(self) -> Hardware:
        """Return the section `hardware` with this node's interface and channels."""
        file, p = self.robot_file, self.parameters
        hardware = parse_hardware(file.section("hardware"), source=file.source, cables=file.robot.cable_names)
        check_pairs(hardware, file.robot, file.source)
        hardware = hardware.on(p.interface, p.channel)
        for bus in hardware.all_buses:
            file.require_motors(bus.interface)
        return hardware

    def _command(self, message: CableCommand) -> None:
        stamp = message.header.stamp
        reason = self._driver.command(message.displacement, message.tension, stamp.sec * 10**9 + stamp.nanosec)
        # The logger's own throttle is not used: it looks up its caller's source each time, which takes longer than the command.
        if reason and time.monotonic() - self._refusal_logged > _LOG_PERIOD:
            self._refusal_logged = time.monotonic()
            self.get_logger().warning(f"command refused: {reason}")

    def _trigger(self, action: Callable[[Bridge, float], tuple[bool, str]]) -> Callable:
        def serve(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            response.success, response.message = self._driver.request(action)
            return response

        return serve

    def _publish(self) -> None:
        """Publish the entries of the driver's queue until the queue ends."""
        count = 0
        while (entry := self._driver.queue.get()) is not None:
            if not self._publishing:
                continue
            if isinstance(entry, ImuSample):
                self._publish_imu(entry, with_temperature=count % _TEMPERATURE_EVERY == 0)
                count += 1
            else:
                self._publish_state(entry)

    def _publish_imu(self, sample: ImuSample, *, with_temperature: bool) -> None:
        message = Imu()
        message.header.stamp = _time(round(1e9 * sample.stamp))
        message.header.frame_id = self.parameters.imu_frame
        a, w = message.linear_acceleration, message.angular_velocity
        a.x, a.y, a.z = sample.specific_force
        w.x, w.y, w.z = sample.angular_rate
        message.orientation_covariance[0] = -1.0  # sensor_msgs/Imu: there is no orientation
        self._imu.publish(message)
        if with_temperature:
            self._temperature.publish(Temperature(header=message.header, temperature=float(sample.temperature)))

    def _publish_state(self, snapshot: CableSnapshot) -> None:
        message = CableState(state=int(snapshot.state), message=snapshot.message)
        message.header.stamp = _time(snapshot.stamp or self.get_clock().now().nanoseconds)
        for name in ("command", "displacement", "velocity", "current", "tension"):
            setattr(message, name, array.array("d", getattr(snapshot, name)))
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
        level = _LEVELS.get(snapshot.state, WARN)
        fault = driver.imu.fault
        state = f"{snapshot.state.name.lower()}: "
        sentence = state + snapshot.message.removeprefix(state) + (f"; {fault}" if fault else "")
        self.report(
            max(level, WARN) if fault else level,
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
            if level == OK and not fault:
                self.get_logger().info(sentence)
            else:
                self.get_logger().warning(sentence)


def _time(nanoseconds: int) -> Time:
    return Time(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)


def main() -> int:
    """Run the node; return the exit code."""
    return run(CanBridge)


if __name__ == "__main__":
    sys.exit(main())
