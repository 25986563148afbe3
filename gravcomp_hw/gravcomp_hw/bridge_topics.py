"""Messages and services that all bridges have: commands, the state of the cables, IMU samples, and requests."""

import array
import math
import time
from collections.abc import Callable

from builtin_interfaces.msg import Time
from gravcomp_node.managed_node import ERROR, OK, WARN
from rclpy.lifecycle import LifecycleNode
from sensor_msgs.msg import Imu, Temperature
from std_srvs.srv import Trigger

from gravcomp.canbus.imu_stream import ImuSample
from gravcomp.motors.state import CableSnapshot, State
from gravcomp_msgs.msg import CableCommand, CableState
from gravcomp_node import SENSOR

_LOG_PERIOD = 1.0  # s, between two log messages about refused commands
_TEMPERATURE_EVERY = 10  # samples; the chip updates its temperature every 1.28 s
_LEVELS = {State.ACTIVE: OK, State.HOLDING: OK, State.HOMING: OK, State.FAULT: ERROR}


def to_time(nanoseconds: int) -> Time:
    """Return the message of a time in ns."""
    return Time(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)


def level(state: State) -> bytes:
    """Return the level of /diagnostics for a state of a bridge."""
    return _LEVELS.get(state, WARN)


def cable_state(snapshot: CableSnapshot, now_ns: int) -> CableState:
    """Return the message of a snapshot, with the stamp of the followed command, else `now_ns`."""
    message = CableState(state=int(snapshot.state), message=snapshot.message)
    message.header.stamp = to_time(snapshot.stamp or now_ns)
    for name in ("command", "displacement", "velocity", "current", "tension"):
        setattr(message, name, array.array("d", getattr(snapshot, name)))
    return message


def trigger(request: Callable, action: Callable) -> Callable[[Trigger.Request, Trigger.Response], Trigger.Response]:
    """Return the callback of a service that has the driver's `request` do `action(bridge, now)`, and answers what it returns."""

    def serve(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success, response.message = request(action)
        return response

    return serve


def follow(node: LifecycleNode, command: Callable) -> Callable[[CableCommand], None]:
    """Return the callback of cable/command that gives the driver's `command` each message, and logs why one is refused."""
    logged = -math.inf

    def take(message: CableCommand) -> None:
        nonlocal logged
        stamp = message.header.stamp
        reason = command(message.displacement, message.tension, stamp.sec * 10**9 + stamp.nanosec)
        # The logger's own throttle is not used: it looks up its caller's source each time, which takes longer than the command.
        if reason and time.monotonic() - logged > _LOG_PERIOD:
            logged = time.monotonic()
            node.get_logger().warning(f"command refused: {reason}")

    return take


class ImuTopics:
    """The topics imu/data_raw and imu/temperature of a node; `frame`: of the IMU."""

    def __init__(self, node: LifecycleNode, frame: str):
        self._node, self._count = node, 0
        self._imu = node.create_publisher(Imu, "imu/data_raw", SENSOR)
        self._temperature = node.create_publisher(Temperature, "imu/temperature", SENSOR)
        # One message for all samples, because making it takes longer than to publish it. It is serialised before the next one,
        # since its node is alone in its process; gravcomp_node.local_topics would hand on the message itself, and its header.
        self._message = Imu()
        self._message.header.frame_id = frame
        self._message.orientation_covariance[0] = -1.0  # sensor_msgs/Imu: there is no orientation

    def publish(self, sample: ImuSample) -> None:
        """Publish a sample, and with one in ten the temperature."""
        message = self._message
        message.header.stamp = to_time(round(1e9 * sample.stamp))
        a, w = message.linear_acceleration, message.angular_velocity
        a.x, a.y, a.z = sample.specific_force
        w.x, w.y, w.z = sample.angular_rate
        self._imu.publish(message)
        if self._count % _TEMPERATURE_EVERY == 0:
            self._temperature.publish(Temperature(header=message.header, temperature=float(sample.temperature)))
        self._count += 1

    def destroy(self) -> None:
        """Destroy the publishers."""
        self._node.destroy_publisher(self._imu)
        self._node.destroy_publisher(self._temperature)
