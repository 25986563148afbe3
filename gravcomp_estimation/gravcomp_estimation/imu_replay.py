"""Node imu_replay: publishes the IMU samples of a recording, in real time or faster, with /clock.

The samples are published reliably and with unlimited history. A subscriber with the same QoS, such as imu_estimator, receives
every sample; a slow one delays the replay. With `exit_at_end` it follows the gravity of an estimator and ends after that of the
last sample: a sample that has arrived is not yet processed.
"""

import time

import numpy as np
from geometry_msgs.msg import Vector3Stamped
from gravcomp_node.managed_node import OK
from rclpy._rclpy_pybind11 import RCLError
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.node import NodeNameNonExistentError
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock as ClockMessage
from sensor_msgs.msg import Imu, Temperature

from gravcomp.config import ConfigError
from gravcomp.graph.parameters.imu_replay import ImuReplayParameters
from gravcomp.recordings.imu import read_recording
from gravcomp_estimation import messages
from gravcomp_estimation.stream import LOSSLESS
from gravcomp_node import SENSOR, ManagedNode, run

TICK = 0.002  # s
LONGEST_TICK = 0.05  # s of publishing before signals and services are handled
# Discovery may be wrong about a subscriber that has just appeared, and connecting takes time.
SETTLE = 1.0  # s
# After the last sample or its gravity: for what subscribers still process; and the longest pause between two gravities before.
LAST, LONGEST_PAUSE = 1.0, 10.0  # s
CLOCK_QOS = QoSProfile(reliability=ReliabilityPolicy.BEST_EFFORT, depth=1)
# ROS interprets time 0 as 'not set', so a recording without absolute times starts at 1 s.
EARLIEST_NS = 1_000_000_000


class ImuReplay(ManagedNode):
    """Publishes a recording on imu/data_raw and imu/temperature, with /clock."""

    name = "imu_replay"
    parameters_class = ImuReplayParameters

    def configure(self) -> None:
        """Read the recording. Raises ConfigError when it cannot be read."""
        parameters = self.parameters
        if not parameters.file:
            raise ConfigError(
                "imu_replay: the parameter file is empty; a rosbag2 folder or an .npz file in BROAD's layout is needed"
            )
        recording = read_recording(parameters.file, parameters.topic or None)
        for note in recording.notes:
            self.get_logger().warning(f"{parameters.file}: {note}")
        shift = max(0, EARLIEST_NS - int(recording.stamp_ns[0]))
        self._recording = recording
        # Places of the events: a temperature by -1 - its index, a sample by its index. In the order of the stamps, where a
        # temperature precedes the sample with the same stamp; samples whose stamps are out of order stay as they are without it.
        self._places, self._stamps = np.arange(len(recording)), recording.stamp_ns + shift
        if recording.temperature is not None:
            readings = len(recording.temperature)
            self._places = np.concatenate([-1 - np.arange(readings), self._places])
            self._stamps = np.concatenate([recording.temperature_stamp_ns + shift, self._stamps])
            order = np.argsort(self._stamps, kind="stable")
            self._places, self._stamps = self._places[order], self._stamps[order]
        self._round_ns = int(recording.duration * 1e9 + 1e9 / recording.rate)
        self._imu = self.create_publisher(Imu, "imu/data_raw", LOSSLESS)
        self._temperature = self.create_publisher(Temperature, "imu/temperature", LOSSLESS)
        self._clock_publisher = self.create_publisher(ClockMessage, "/clock", CLOCK_QOS) if parameters.clock else None
        self._last_sample_ns = int(self._stamps[self._places >= 0][-1])
        self._estimated = (
            self.create_subscription(Vector3Stamped, "gravity", self._follow, SENSOR) if parameters.exit_at_end else None
        )

    def activate(self) -> None:
        """Start waiting for subscribers."""
        self._next = 0
        self._shift_ns = 0
        self._begin: float | None = None  # monotonic, s
        self._waiting_since = time.monotonic()
        self._complete_since: float | None = None
        self._ended: float | None = None
        self._followed_at = 0.0  # monotonic, s: the last gravity came
        self._followed_ns: int | None = None  # its stamp
        self._timer = self.create_timer(TICK, self._tick, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self.report(OK, f"waiting for a subscriber of {self._imu.topic_name}")

    def deactivate(self) -> None:
        """Stop publishing."""
        self.destroy_timer(self._timer)

    def cleanup(self) -> None:
        """Destroy publishers and subscription."""
        if self._estimated is not None:
            self.destroy_subscription(self._estimated)
        for publisher in (self._imu, self._temperature, self._clock_publisher):
            if publisher is not None:
                self.destroy_publisher(publisher)

    def _tick(self) -> None:
        now = time.monotonic()
        if self._ended is not None:
            # The subscribers may still process the last samples.
            awaited = self._followed_ns is not None and self._followed_ns < self._last_sample_ns
            quiet = now - max(self._ended, self._followed_at)
            if self.parameters.exit_at_end and quiet > (LONGEST_PAUSE if awaited else LAST):
                self.finished = True
            return
        if self._begin is None:
            if not self._is_complete():
                self._complete_since = None
            elif self._complete_since is None:
                self._complete_since = now
            settled = self._complete_since is not None and now - self._complete_since >= SETTLE
            if not settled and now - self._waiting_since < self.parameters.wait_for_subscribers:
                return
            self._begin = now
            self.get_logger().info(f"playing {len(self._recording)} samples of {self.parameters.file}")
            self.report(OK, f"playing {self.parameters.file}")
        first_ns = int(self._stamps[0])
        while self._next < len(self._stamps):
            stamp = int(self._stamps[self._next])
            due = self._begin + (stamp + self._shift_ns - first_ns) * 1e-9 / self.parameters.rate if self.parameters.rate else 0.0
            if due > time.monotonic() or time.monotonic() - now > LONGEST_TICK:
                return
            if not self._publish(stamp, int(self._places[self._next])):
                return
            self._next += 1
            if self._next == len(self._stamps) and self.parameters.loop:
                self._next = 0
                self._shift_ns += self._round_ns
        self._imu.wait_for_all_acked(Duration(seconds=5.0))
        self._ended = time.monotonic()
        self.get_logger().info("the recording has ended")
        self.report(OK, "the recording has ended")

    def _follow(self, message: Vector3Stamped) -> None:
        stamp = message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec
        # Gravity that another source goes on to publish does not delay the end.
        if self._followed_ns is None or self._followed_ns < min(stamp, self._last_sample_ns):
            self._followed_at, self._followed_ns = time.monotonic(), stamp

    def _is_complete(self) -> bool:
        """Return whether a reliable subscriber exists and every node in `wait_for` is active."""
        taken = self.get_subscriptions_info_by_topic(self._imu.topic_name)
        reliable = any(s.qos_profile.reliability == ReliabilityPolicy.RELIABLE for s in taken)
        return reliable and all(map(self._has_begun, self.parameters.wait_for))

    def _has_begun(self, node: str) -> bool:
        """Return whether the node is active, which its subscriptions show."""
        try:
            subscribed = self.get_subscriber_names_and_types_by_node(node, self.get_namespace())
        except NodeNameNonExistentError:
            return False
        return any(topic not in ("/clock", "/parameter_events") for topic, _ in subscribed)

    def _publish(self, stamp: int, place: int) -> bool:
        """Publish one event; return False when the subscriber is too slow and the event must be repeated."""
        stamp += self._shift_ns
        frame = self.parameters.imu_frame
        try:
            if place >= 0:
                gyro, accel = self._recording.gyro[place].tolist(), self._recording.accel[place].tolist()
                self._imu.publish(messages.raw_imu(stamp, frame, gyro, accel))
            else:
                temperature = float(self._recording.temperature[-1 - place])
                reading = Temperature(header=messages.header(stamp, frame), temperature=temperature)
                self._temperature.publish(reading)
        except RCLError:
            return False
        if self._clock_publisher is not None:
            clock = ClockMessage()
            clock.clock.sec, clock.clock.nanosec = divmod(stamp, 1_000_000_000)
            self._clock_publisher.publish(clock)
        return True


def main() -> int:
    """Run the node; return the exit code."""
    return run(ImuReplay)
