"""Node virtual_robot: sends CAN frames as the hardware does, and publishes the ground truth for evaluation.

Mechanics, motors, board and faults are in `gravcomp.virtual`; a thread of `RealtimeRobot` steps them. No node of the loop
subscribes to truth/*.
"""

import dataclasses
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
from geometry_msgs.msg import Point, Pose, PoseArray, PoseStamped, Quaternion, QuaternionStamped, Vector3, Vector3Stamped
from gravcomp_node.managed_node import ERROR, OK, WARN
from gravcomp_node.polled import Polled
from rclpy.duration import Duration
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from gravcomp.canbus.bus import BusError
from gravcomp.config import ConfigError, parse_yaml
from gravcomp.firmware.model_fit import blob_for
from gravcomp.firmware.model_settings import LoopParameters
from gravcomp.graph.parameters.virtual_robot import VirtualRobotNodeParameters
from gravcomp.view.touches import HAND
from gravcomp.virtual.described import described
from gravcomp.virtual.faults import Fault
from gravcomp.virtual.load_cells import VirtualLoadCells
from gravcomp.virtual.motion import rotation_from_quaternion
from gravcomp.virtual.motions import make_motion
from gravcomp.virtual.realtime import RealtimeRobot
from gravcomp.virtual.robot import VirtualRobot
from gravcomp.virtual.tracker import VirtualTracker
from gravcomp.virtual.truth import Truth
from gravcomp_msgs.msg import VirtualForces
from gravcomp_node import COMMAND, SENSOR, ManagedNode, run

# Several faults may arrive in a row, and none must be lost.
_FAULTS = QoSProfile(reliability=ReliabilityPolicy.RELIABLE, depth=20)


class VirtualRobotNode(ManagedNode):
    """Simulates the hardware: rod, cables, motors and IMU board behind CAN frames."""

    name = "virtual_robot"
    parameters_class = VirtualRobotNodeParameters

    def configure(self) -> None:
        """Create the robot and the publishers. Raises ConfigError for a wrong robot file or recording."""
        virtual = described(self.robot_file, None if self.parameters.seed < 0 else self.parameters.seed)
        hardware, parameters = virtual.hardware, virtual.given
        if self.parameters.feedback_rate:
            motors = dataclasses.replace(parameters.motors, feedback_rate=self.parameters.feedback_rate)
            parameters = dataclasses.replace(parameters, motors=motors)
        motion = make_motion(self.parameters, self.robot_file.robot.imu_mount.rotation, virtual.seed)
        hardware = hardware.on(self.parameters.interface, self.parameters.channel)
        scene = self.robot_file.scene
        board = self.parameters.board
        model = blob_for(LoopParameters.of(self.robot_file)) if board == "standalone" else None
        robot = VirtualRobot(parameters, virtual.robot, hardware, virtual.seed, motion, board, scene, model)
        self.get_logger().info(robot.true.summary())
        self._publisher_tip = self.create_publisher(PoseStamped, "truth/tip", SENSOR)
        self._publisher_backbone = self.create_publisher(PoseArray, "truth/backbone", SENSOR)
        self._publisher_gravity = self.create_publisher(Vector3Stamped, "truth/gravity", SENSOR)
        self._publisher_forces = self.create_publisher(VirtualForces, "truth/forces", SENSOR)
        self._tracker, self._publisher_measured = None, None
        if self.parameters.tracker.rate > 0.0:
            self._tracker = VirtualTracker(self.parameters.tracker, virtual.robot.length, virtual.seed)
            self._publisher_measured = self.create_publisher(PoseStamped, "measured/tip", SENSOR)
        self._cells, self._publisher_tension = None, None
        if self.parameters.load_cells.rate > 0.0:
            self._cells = VirtualLoadCells(self.parameters.load_cells, virtual.robot.limits.tension_max, virtual.seed)
            self._publisher_tension = self.create_publisher(JointState, "measured/tension", SENSOR)
        self._live = RealtimeRobot(robot, hardware, self._publish, self.parameters.truth_rate, self._commanded_base)
        self._base: Polled | None = None

    def activate(self) -> None:
        """Join the bus and start the robot's thread. Raises ConfigError when the bus cannot be opened."""
        # The publisher of the orientation sees by the subscription whether it has an effect. The robot's thread polls the topic:
        # an arm publishes 100 times per second, and an executor that wakes each time would use as much CPU time as the robot.
        if self.parameters.steerable or self.parameters.motion == "topic":
            self._base = Polled(self, QuaternionStamped, "virtual/base_orientation", COMMAND)
        try:
            self._live.start()
        except BusError as error:
            raise ConfigError(str(error)) from error
        self._orders = [
            self.create_subscription(String, "virtual/fault", self._inject, _FAULTS),
            self.create_subscription(String, "virtual/hand", self._hold, COMMAND),
            self.create_subscription(String, "virtual/wall", self._place_wall, COMMAND),
        ]
        self._watch = self.create_timer(0.5, self._report)

    def deactivate(self) -> None:
        """Stop the robot's thread and leave the bus."""
        self.destroy_timer(self._watch)
        for subscription in self._orders:
            self.destroy_subscription(subscription)
        self._live.stop()
        if self._base is not None:
            self._base.destroy()
            self._base = None

    def cleanup(self) -> None:
        """Destroy the publishers."""
        for name in ("tip", "backbone", "gravity", "forces", "measured", "tension"):
            name = f"_publisher_{name}"
            if getattr(self, name, None) is not None:
                self.destroy_publisher(getattr(self, name))
                delattr(self, name)

    def _publish(self, truth: Truth) -> None:
        """Publish the ground truth where it has a subscriber, and what the tracker measures. Called from the robot's thread."""
        stamp, frame = self.get_clock().now().to_msg(), self.parameters.base_frame
        messages = []
        if self._publisher_tip.get_subscription_count():
            messages.append((self._publisher_tip, PoseStamped(pose=_pose(truth.tip_position, truth.tip_orientation))))
        if self._publisher_gravity.get_subscription_count():
            gravity = Vector3Stamped()
            gravity.vector.x, gravity.vector.y, gravity.vector.z = truth.gravity.tolist()
            messages.append((self._publisher_gravity, gravity))
        if self._publisher_backbone.get_subscription_count():
            poses = [_pose(p, q) for p, q in zip(truth.backbone_position, truth.backbone_orientation)]
            messages.append((self._publisher_backbone, PoseArray(poses=poses)))
        if self._publisher_forces.get_subscription_count():
            messages.append((self._publisher_forces, _forces(truth)))
        if self._tracker is not None:
            for measured in self._tracker.observe(truth):
                message = PoseStamped(pose=_pose(measured.position, measured.orientation))
                taken = self.get_clock().now() - Duration(seconds=truth.time - measured.time)
                message.header.stamp, message.header.frame_id = taken.to_msg(), frame
                self._publisher_measured.publish(message)
        tension = None if self._cells is None else self._cells.observe(truth)
        if tension is not None:
            state = JointState(name=list(self.robot_file.robot.cable_names), effort=tension.tolist())
            state.header.stamp = stamp
            self._publisher_tension.publish(state)
        for publisher, message in messages:
            message.header.stamp, message.header.frame_id = stamp, frame
            publisher.publish(message)

    def _commanded_base(self) -> np.ndarray | None:
        """Return the newest commanded rotation (3, 3) of the base, or None. Called from the robot's thread."""
        received = self._base.take() if self._base is not None else None
        if received is None:
            return None
        q = received.message.quaternion
        try:
            return rotation_from_quaternion(q.x, q.y, q.z, q.w)
        except ValueError as error:
            self.get_logger().warning(f"virtual/base_orientation: {error}")
            return None

    def _inject(self, message: String) -> None:
        """`{kind: drop, frames: imu, duration: 2}` starts a fault, `clear` ends all faults."""
        if self._obey(message, "virtual/fault", self._order_fault):
            self.get_logger().info(f"fault: {message.data}")

    def _order_fault(self, order: Any, source: str) -> None:
        if order == "clear":
            self._live.robot.clear_faults()
        else:
            self._live.robot.inject(Fault.parse(order, source))

    def _hold(self, message: String) -> None:
        """`{place_mm: [10, 0, 95]}` pulls the tip there by a spring, `release` lets go."""
        self._obey(message, "virtual/hand", lambda order, source: self._live.robot.bystander.order_hand(
            order, source, self._live.robot.time))  # fmt: skip

    def _place_wall(self, message: String) -> None:
        """A plane in the keys of `scene.planes` puts the wall there, `clear` takes it away."""
        self._obey(message, "virtual/wall", self._live.robot.bystander.order_wall)

    def _obey(self, message: String, topic: str, order: Callable[[Any, str], None]) -> bool:
        """Carry out an order in YAML and return True; one that is refused is named in the log and changes nothing."""
        try:
            wanted = parse_yaml(message.data, topic)
            with self._live.lock:
                order(wanted, topic)
        except ConfigError as error:
            self.get_logger().error(str(error))
            return False
        return True

    def _report(self) -> None:
        live = self._live
        if live.error is not None:
            self.get_logger().fatal(f"the virtual robot has stopped: {live.error!r}")
            self.report(ERROR, f"stopped: {live.error!r}")
            self.finished = True
            return
        with live.lock:
            faults, refused, unresolved = live.robot.faults, live.robot.refused, live.robot.unresolved
        kinds = ", ".join(fault.kind for fault in faults)
        sentence = f"faults: {kinds}" if kinds else "on the bus" if live.link.is_open else f"no bus: {live.link.status}"
        self.report(
            OK if live.link.is_open and not kinds else WARN,
            sentence,
            lost_time=f"{live.lost_time:.3f} s",
            refused_frames=refused,
            unresolved_steps=unresolved,
            frames_received=live.link.counters.received,
            frames_sent=live.link.counters.sent,
        )


def _pose(position: np.ndarray, orientation: np.ndarray) -> Pose:
    x, y, z = position.tolist()
    qx, qy, qz, qw = orientation.tolist()
    return Pose(position=Point(x=x, y=y, z=z), orientation=Quaternion(x=qx, y=qy, z=qz, w=qw))


def _forces(truth: Truth) -> VirtualForces:
    """Return the message of the forces that act from outside."""
    message = VirtualForces(source=list(truth.contact_obstacle), has_wall=truth.wall is not None)
    places, forces = list(truth.contact_place), list(truth.contact_force)
    if truth.hand_force.any():
        message.source.append(HAND)
        places.append(truth.tip_position)
        forces.append(truth.hand_force)
    message.position = [Point(x=x, y=y, z=z) for x, y, z in map(np.ndarray.tolist, places)]
    message.force = [Vector3(x=x, y=y, z=z) for x, y, z in map(np.ndarray.tolist, forces)]
    if truth.wall is not None:
        point, normal = message.wall_point, message.wall_normal
        point.x, point.y, point.z = truth.wall[0].tolist()
        normal.x, normal.y, normal.z = truth.wall[1].tolist()
    return message


def main() -> int:
    """Run the node; return the exit code."""
    return run(VirtualRobotNode)


if __name__ == "__main__":
    sys.exit(main())
