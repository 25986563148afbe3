"""Messages and services that all bridges have: commands, the state of the cables, IMU samples, and requests."""

import array
import math
import time
from collections.abc import Callable

from builtin_interfaces.msg import Time
from gravcomp_node.managed_node import ERROR, OK, WARN
from gravcomp_node.serialised_command import read_command
from gravcomp_node.serialised_imu import SampleWriter
from rclpy.lifecycle import LifecycleNode
from rclpy.subscription import Subscription
from sensor_msgs.msg import Imu, Temperature
from std_msgs.msg import Header
from std_srvs.srv import Trigger

from gravcomp.canbus.imu_stream import ImuSample
from gravcomp.motors.state import CableSnapshot, State
from gravcomp_msgs.msg import CableCommand, CableState
from gravcomp_node import COMMAND, SENSOR

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


def subscribe_command(node: LifecycleNode, command: Callable) -> Subscription:
    """Subscribe to cable/command: the driver's `command` gets each one, and why one is refused is logged."""
    logged = -math.inf

    def take(serialised: bytes) -> None:
        nonlocal logged
        try:
            stamp_ns, displacement, tension = read_command(serialised)
        except ValueError as error:
            reason = str(error)
        else:
            reason = command(displacement, tension, stamp_ns)
        # The logger's own throttle is not used: it looks up its caller's source each time, which takes longer than the command.
        if reason and time.monotonic() - logged > _LOG_PERIOD:
            logged = time.monotonic()
            node.get_logger().warning(f"command refused: {reason}")

    return node.create_subscription(CableCommand, "cable/command", take, COMMAND, raw=True)


class ImuTopics:
    """The topics imu/data_raw and imu/temperature of a node; `frame`: of the IMU."""

    def __init__(self, node: LifecycleNode, frame: str):
        self._node, self._count = node, 0
        self._imu = node.create_publisher(Imu, "imu/data_raw", SENSOR)
        self._temperature = node.create_publisher(Temperature, "imu/temperature", SENSOR)
        self._frame, self._writer = frame, SampleWriter(frame)

    def publish(self, sample: ImuSample) -> None:
        """Publish a sample, and with one in ten the temperature."""
        stamp_ns = round(1e9 * sample.stamp)
        self._imu.publish(self._writer.write(stamp_ns, sample.angular_rate, sample.specific_force))
        if self._count % _TEMPERATURE_EVERY == 0:
            header = Header(stamp=to_time(stamp_ns), frame_id=self._frame)
            self._temperature.publish(Temperature(header=header, temperature=float(sample.temperature)))
        self._count += 1

    def destroy(self) -> None:
        """Destroy the publishers."""
        self._node.destroy_publisher(self._imu)
        self._node.destroy_publisher(self._temperature)
