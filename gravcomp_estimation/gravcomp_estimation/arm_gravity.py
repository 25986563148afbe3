"""Node arm_gravity: gravity in the robot's base from the pose of the arm that carries it, in place of the IMU or to check it.

The arm measures its pose with encoders, the IMU measures gravity. If both are available and disagree, one of them is wrong: a
loose mount, a wrong URDF or a saturated sensor.
"""

import sys
import time
from typing import Any

import numpy as np
from geometry_msgs.msg import Vector3Stamped
from gravcomp_node.managed_node import ERROR, OK, WARN
from gravcomp_node.polled import Polled
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Header, String

from gravcomp.arm.acceleration import CarriedPoint
from gravcomp.arm.chain import Chain, angle_between, gravity_in
from gravcomp.arm.description import read_urdf
from gravcomp.arm.frames import FrameTree
from gravcomp.arm.fusion import GravityFusion
from gravcomp.config import ConfigError
from gravcomp.graph.parameters.arm_gravity import ArmGravityParameters
from gravcomp.virtual.motion import rotation_from_quaternion
from gravcomp_node import LATCHED, SENSOR, ManagedNode, run

_CHECK_PERIOD = 0.1  # s, between two checks of arm and IMU
_SHOWN = 8  # names in a message
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
        self._point: CarriedPoint | None = None
        self._refused = ""  # why the last robot_description is not usable
        if self.parameters.source == "joint_states" and self.parameters.urdf:
            self._take_urdf(read_urdf(self.parameters.urdf), self.parameters.urdf)
        if self.parameters.feed_acceleration and self.parameters.source != "joint_states":
            raise ConfigError("arm_gravity: feed_acceleration needs source: joint_states; TF has no stamps that are dense enough")
        topic = "gravity/arm" if self.parameters.use == "check" else "gravity"
        self._gravity = self.create_publisher(Vector3Stamped, topic, SENSOR)
        self._acceleration = None
        if self.parameters.feed_acceleration:
            self._acceleration = self.create_publisher(Vector3Stamped, "arm/acceleration", SENSOR)

    def activate(self) -> None:
        """Create the subscriptions. Raises ConfigError when the source is tf and tf2_msgs is not installed."""
        self._positions: dict[str, float] = {}
        p = self.parameters
        self._frames = FrameTree(p.base_frame, p.world_frame, STALE)
        self._fusion = GravityFusion(p.imu_std, p.arm_std, p.tolerance, p.patience, STALE)
        self._arm: tuple[float, np.ndarray] | None = None  # monotonic s, (3,)
        self._imu: tuple[float, np.ndarray] | None = None
        self._agreed = time.monotonic()
        self._polled_joints: Polled | None = None
        self._polled_imu: Polled | None = None
        if self.parameters.source == "tf":
            self._inputs = self._tf_subscriptions()
        elif self.parameters.use != "check" or self.parameters.feed_acceleration:
            self._inputs = [self.create_subscription(JointState, "joint_states", self._on_joints, QoSProfile(depth=10))]
        else:
            # A check needs only the newest message of each period.
            self._inputs = []
            self._polled_joints = Polled(self, JointState, "joint_states", QoSProfile(depth=_KEPT))
        if self.parameters.source == "joint_states" and not self.parameters.urdf:
            self._inputs.append(self.create_subscription(String, "robot_description", self._on_description, LATCHED))
        if self.parameters.use == "check":
            self._polled_imu = Polled(self, Vector3Stamped, "gravity", SENSOR)
        elif self.parameters.use == "fuse":
            self._inputs.append(self.create_subscription(Vector3Stamped, "gravity/imu", self._on_imu, SENSOR))
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
        for publisher in (getattr(self, "_gravity", None), getattr(self, "_acceleration", None)):
            if publisher is not None:
                self.destroy_publisher(publisher)

    def parameters_changed(self, old: ArmGravityParameters, new: ArmGravityParameters) -> None:
        """Apply new deviations and limits to the fusion."""
        if hasattr(self, "_fusion"):
            self._fusion.trust(new.imu_std, new.arm_std, new.tolerance, new.patience)

    # The arm's pose.

    def _on_description(self, message: String) -> None:
        try:
            self._take_urdf(message.data, "robot_description")
        except ConfigError as error:
            self._refused = str(error)
            self.get_logger().error(self._refused)

    def _take_urdf(self, text: str, source: str) -> None:
        self._chain = Chain(text, self.parameters.base_frame, self.parameters.world_frame, source)
        self._point = CarriedPoint(self._chain, np.array(self.robot_file.robot.imu_mount.position))
        self._refused = ""

    def _on_joints(self, message: JointState) -> None:
        self._positions.update(_finite(message))
        self._take_positions(message.header)

    def _take_positions(self, header: Header) -> None:
        if self._chain is None or not all(name in self._positions for name in self._chain.moving):
            return
        self._publish_gravity(self._chain.gravity(self._positions), header)
        if self._acceleration is not None and self._point is not None:
            acceleration = self._point.take(header.stamp.sec + 1e-9 * header.stamp.nanosec, self._positions)
            if acceleration is not None:
                self._acceleration.publish(self._vector(acceleration, header))

    def _tf_subscriptions(self) -> list:
        try:
            from tf2_msgs.msg import TFMessage
        except ImportError as error:
            raise ConfigError(
                "arm_gravity: source is 'tf' and tf2_msgs is not installed; use a ROS installation or joint_states"
            ) from error
        latched = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        return [
            self.create_subscription(TFMessage, "/tf", lambda m: self._on_tf(m, static=False), QoSProfile(depth=100)),
            self.create_subscription(TFMessage, "/tf_static", lambda m: self._on_tf(m, static=True), latched),
        ]

    def _on_tf(self, message: Any, *, static: bool) -> None:
        now = time.monotonic()
        for t in message.transforms:
            q, stamp = t.transform.rotation, t.header.stamp
            try:
                rotation = rotation_from_quaternion(q.x, q.y, q.z, q.w)
            except ValueError as error:
                self.get_logger().warning(f"TF of '{t.child_frame_id}': {error}", throttle_duration_sec=5.0)
                continue
            seconds = stamp.sec + 1e-9 * stamp.nanosec
            self._frames.take(t.child_frame_id, t.header.frame_id, rotation, seconds, now, static=static)
        rotation = self._frames.rotation(now)
        if rotation is not None:
            self._publish_gravity(gravity_in(rotation), message.transforms[-1].header)

    def _publish_gravity(self, gravity: np.ndarray, header: Header) -> None:
        now = time.monotonic()
        self._arm = now, gravity
        alone = self._fusion.arm(now, gravity) if self.parameters.use == "fuse" else gravity
        if alone is not None:
            self._gravity.publish(self._vector(alone, header))

    def _on_imu(self, message: Vector3Stamped) -> None:
        """Publish the fused gravity, with the stamp of the IMU's sample."""
        v, now = message.vector, time.monotonic()
        gravity = np.array([v.x, v.y, v.z])
        if not 0.0 < float(np.linalg.norm(gravity)) < np.inf:
            return
        self._imu = now, gravity
        self._gravity.publish(self._vector(self._fusion.imu(now, gravity), message.header))

    def _vector(self, value: np.ndarray, header: Header) -> Vector3Stamped:
        message = Vector3Stamped()
        message.header.stamp, message.header.frame_id = header.stamp, self.parameters.base_frame
        message.vector.x, message.vector.y, message.vector.z = map(float, value)
        return message

    # The check.

    def _read_polled(self) -> None:
        """Read the polled topics.

        All messages of joint_states are read, because the robot's cables are there as well, and an arm may publish its joints in
        several messages.
        """
        if self._polled_joints is not None:
            received = self._polled_joints.take_all()
            for one in received:
                self._positions.update(_finite(one.message))
            if received:
                self._take_positions(received[-1].message.header)
        if self._polled_imu is not None and (newest := self._polled_imu.take()):
            v = newest.message.vector
            self._imu = time.monotonic(), np.array([v.x, v.y, v.z])

    def _check(self) -> None:
        self._read_polled()
        now = time.monotonic()
        if self._arm is None or now - self._arm[0] > STALE:
            self.report(WARN, self._missing())
        elif self.parameters.use == "publish":
            self.report(OK, "gravity from the arm")
        elif self._imu is None or now - self._imu[0] > STALE:
            what = "no gravity is received from the IMU"
            self.report(WARN, what if self.parameters.use == "check" else f"{what}: gravity from the arm alone")
        elif self.parameters.use == "fuse":
            self._report_fusion()
        else:
            self._compare(now)

    def _missing(self) -> str:
        """Return why there is no pose of the arm."""
        if self.parameters.source == "tf":
            return f"no pose of the arm: {self._frames.problem or 'no TF is received'}"
        if self._chain is None:
            return self._refused or "no URDF has been received"
        absent = [name for name in self._chain.moving if name not in self._positions]
        if not absent or not self._positions:
            return "no pose of the arm is received"
        others = ", ".join(sorted(set(self._positions) - set(self._chain.moving))[:_SHOWN])
        return f"joint_states does not bring {', '.join(absent)}" + (f"; it has {others}: is a prefix missing?" if others else "")

    def _report_fusion(self) -> None:
        angle = self._fusion.angle
        degrees = None if angle is None else round(float(np.degrees(angle)), 2)
        if self._fusion.disagrees:
            self._report_disagreement(f"arm and IMU disagree on gravity by {degrees:g} deg: the IMU counts alone", degrees)
        else:
            self.report(OK, "gravity from arm and IMU", angle_deg=degrees)

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
        self._report_disagreement(sentence, degrees)

    def _report_disagreement(self, sentence: str, degrees: float | None) -> None:
        self.get_logger().error(sentence, throttle_duration_sec=5.0)
        self.report(ERROR, sentence, angle_deg=degrees)


def _finite(message: JointState) -> dict[str, float]:
    """Return the positions of a message by joint, without those that are not numbers; empty where the arrays do not fit."""
    if len(message.name) != len(message.position):
        return {}
    return {name: position for name, position in zip(message.name, message.position) if np.isfinite(position)}


def main() -> int:
    """Run the node; return the exit code."""
    return run(ArmGravity)


if __name__ == "__main__":
    sys.exit(main())
