"""Node arm_gravity: gravity in the robot's base from the pose of the arm that carries it, in place of the IMU or to check it.

The arm measures its pose with encoders, the IMU measures gravity. If both are available and disagree, one of them is wrong: a
loose mount, a wrong URDF or a saturated sensor.
"""

import time
from typing import Any

import numpy as np
from geometry_msgs.msg import Vector3Stamped
from gravcomp_node.managed_node import ERROR, OK, WARN
from gravcomp_node.polled import Polled
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Header, String

from gravcomp.arm.chain import Chain, angle_between, gravity_in
from gravcomp.config import ConfigError
from gravcomp.graph.parameters.arm_gravity import ArmGravityParameters
from gravcomp.virtual.motion import rotation_from_quaternion
from gravcomp_node import LATCHED, SENSOR, ManagedNode, run

_CHECK_PERIOD = 0.1  # s, between two checks of arm and IMU
_KEPT = 50  # messages of joint_states that are kept between two checks
# A source without messages for longer is stale.
STALE = 0.5  # s


class ArmGravity(ManagedNode):
    """Computes gravity from the arm's pose, and publishes it or compares it with the IMU's."""

    name = "arm_gravity"
    parameters_class = ArmGravityParameters

    def configure(self) -> None:
        """Read the URDF if the parameter gives one. Raises ConfigError when it is not usable."""
        self._chain: Chain | None = None
        if self.parameters.source == "joint_states" and self.parameters.urdf:
            try:
                with open(self.parameters.urdf, encoding="utf-8") as file:
                    self._take_urdf(file.read(), self.parameters.urdf)
            except OSError as error:
                raise ConfigError(f"arm_gravity: urdf '{self.parameters.urdf}' cannot be read: {error.strerror}") from error
        topic = "gravity" if self.parameters.use == "publish" else "gravity/arm"
        self._gravity = self.create_publisher(Vector3Stamped, topic, SENSOR)

    def activate(self) -> None:
        """Create the subscriptions. Raises ConfigError when the source is tf and tf2_msgs is not installed."""
        self._positions: dict[str, float] = {}
        self._frames: dict[str, tuple[str, np.ndarray]] = {}
        self._arm: tuple[float, np.ndarray] | None = None  # monotonic s, (3,)
        self._imu: tuple[float, np.ndarray] | None = None
        self._agreed = time.monotonic()
        self._polled_joints: Polled | None = None
        self._polled_imu: Polled | None = None
        if self.parameters.source == "tf":
            self._inputs = self._tf_subscriptions()
        elif self.parameters.use == "publish":
            self._inputs = [self.create_subscription(JointState, "joint_states", self._on_joints, QoSProfile(depth=10))]
        else:
            # A check needs only the newest message of each period.
            self._inputs = []
            self._polled_joints = Polled(self, JointState, "joint_states", QoSProfile(depth=_KEPT))
        if self.parameters.source == "joint_states" and not self.parameters.urdf:
            self._inputs.append(self.create_subscription(String, "robot_description", self._on_description, LATCHED))
        if self.parameters.use == "check":
            self._polled_imu = Polled(self, Vector3Stamped, "gravity", SENSOR)
        self._watch = self.create_timer(_CHECK_PERIOD, self._check)

    def deactivate(self) -> None:
        """Destroy timer and subscriptions."""
        self.destroy_timer(self._watch)
        for subscription in self._inputs:
            self.destroy_subscription(subscription)
        for polled in (self._polled_joints, self._polled_imu):
            if polled is not None:
                polled.destroy()

    def cleanup(self) -> None:
        """Destroy the publisher."""
        if hasattr(self, "_gravity"):
            self.destroy_publisher(self._gravity)

    # The arm's pose.

    def _on_description(self, message: String) -> None:
        try:
            self._take_urdf(message.data, "robot_description")
        except ConfigError as error:
            self.get_logger().error(str(error))

    def _take_urdf(self, text: str, source: str) -> None:
        self._chain = Chain(text, self.parameters.base_frame, self.parameters.world_frame, source)

    def _on_joints(self, message: JointState) -> None:
        self._positions.update(zip(message.name, message.position))
        self._take_positions(message.header)

    def _take_positions(self, header: Header) -> None:
        if self._chain and all(name in self._positions for name in self._chain.moving):
            self._publish_gravity(self._chain.gravity(self._positions), header)

    def _tf_subscriptions(self) -> list:
        try:
            from tf2_msgs.msg import TFMessage
        except ImportError as error:
            raise ConfigError(
                "arm_gravity: source is 'tf' and tf2_msgs is not installed; use a ROS installation or joint_states"
            ) from error
        latched = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        return [
            self.create_subscription(TFMessage, "/tf", self._on_tf, QoSProfile(depth=100)),
            self.create_subscription(TFMessage, "/tf_static", self._on_tf, latched),
        ]

    def _on_tf(self, message: Any) -> None:
        for t in message.transforms:
            q = t.transform.rotation
            self._frames[t.child_frame_id] = t.header.frame_id, rotation_from_quaternion(q.x, q.y, q.z, q.w)
        frame, rotation = self.parameters.base_frame, np.eye(3)
        for _ in range(len(self._frames) + 1):
            if frame == self.parameters.world_frame:
                self._publish_gravity(gravity_in(rotation), message.transforms[-1].header)
                return
            if frame not in self._frames:
                return
            frame, above = self._frames[frame]
            rotation = above @ rotation

    def _publish_gravity(self, gravity: np.ndarray, header: Header) -> None:
        self._arm = time.monotonic(), gravity
        message = Vector3Stamped()
        message.header.stamp, message.header.frame_id = header.stamp, self.parameters.base_frame
        message.vector.x, message.vector.y, message.vector.z = map(float, gravity)
        self._gravity.publish(message)

    # The check.

    def _read_polled(self) -> None:
        """Read the polled topics.

        All messages of joint_states are read, because the robot's cables are there as well, and an arm may publish its joints in
        several messages.
        """
        if self._polled_joints is not None:
            received = self._polled_joints.take_all()
            for one in received:
                self._positions.update(zip(one.message.name, one.message.position))
            if received:
                self._take_positions(received[-1].message.header)
        if self._polled_imu is not None and (newest := self._polled_imu.take()):
            v = newest.message.vector
            self._imu = time.monotonic(), np.array([v.x, v.y, v.z])

    def _check(self) -> None:
        self._read_polled()
        now = time.monotonic()
        if self._arm is None or now - self._arm[0] > STALE:
            missing = (
                "no URDF has been received"
                if self.parameters.source == "joint_states" and self._chain is None
                else "no pose of the arm is received"
            )
            self.report(WARN, missing)
        elif self.parameters.use == "publish":
            self.report(OK, "gravity from the arm")
        elif self._imu is None or now - self._imu[0] > STALE:
            self.report(WARN, "no gravity is received from the IMU")
        else:
            self._compare(now)

    def _compare(self, now: float) -> None:
        angle = angle_between(self._arm[1], self._imu[1])
        if angle <= self.parameters.tolerance:
            self._agreed = now
        degrees = round(float(np.degrees(angle)), 2)
        if now - self._agreed <= self.parameters.patience:
            self.report(OK, "arm and IMU agree on gravity", angle_deg=degrees)
            return
        sentence = (
            f"arm and IMU disagree on gravity by {degrees:g} deg: is the IMU's mount, the URDF or one of the sensors wrong?"
        )
        self.get_logger().error(sentence, throttle_duration_sec=5.0)
        self.report(ERROR, sentence, angle_deg=degrees)


def main() -> int:
    """Run the node; return the exit code."""
    return run(ArmGravity)
