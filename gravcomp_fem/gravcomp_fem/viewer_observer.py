"""The viewer's subscriptions, and the snapshot of the graph that the page shows."""

import time
from typing import TYPE_CHECKING

import numpy as np
from geometry_msgs.msg import PoseArray, PoseStamped
from gravcomp_node.polled import Polled, Received
from rclpy.lifecycle import LifecycleNode
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.time import Time

from gravcomp.description import Robot
from gravcomp.inverse import Holdable, TargetError
from gravcomp.view.backbone import Backbone, arc_backbone, rest_backbone
from gravcomp.view.snapshot import Snapshot, TargetView
from gravcomp.view.touches import Touch, model_touches
from gravcomp_fem.conversion import backbone_of, backbone_of_poses, contact_of, pose_target, shape_target, vector_of
from gravcomp_msgs.msg import CableCommand, CableState, ControllerStatus, Deformation, ShapeTarget, VirtualForces, WrenchEstimate
from gravcomp_node import COMMAND, LATCHED

if TYPE_CHECKING:
    from gravcomp.scene.scene import Scene

_STREAM = QoSProfile(reliability=ReliabilityPolicy.BEST_EFFORT, depth=1)
_LEVELS = {
    ControllerStatus.INACTIVE: "off",
    ControllerStatus.OK: "ok",
    ControllerStatus.RELAXING: "ok",
    ControllerStatus.SOLVER_FAILED: "error",
}
_MOTOR_STATES = {
    getattr(CableState, name): name.lower()
    for name in ("UNCONFIGURED", "INACTIVE", "HOMING", "ACTIVE", "HOLDING", "STOPPED", "FAULT")
}
# A stream without messages for longer is not shown.
_STALE = 1.0  # s
# A stamp that differs more from this clock comes from another clock: that of a replay or of another machine.
_CLOCK_TOLERANCE = 10.0  # s


class GraphObserver:
    """Reads the newest message of each topic for a robot with these walls around it; None: it has none.

    Attribute: misfit, a sentence about messages that do not fit this robot and are not shown; empty where all fit.
    """

    def __init__(self, node: LifecycleNode, robot: Robot, walls: "Scene | None"):
        self._node, self._length, self._walls = node, robot.length, walls
        self._cables = len(robot.cables)
        self.misfit = ""
        self._streams = {
            "deformation": Polled(node, Deformation, "robot/deformation", _STREAM),
            "command": Polled(node, CableCommand, "cable/command", _STREAM),
            "motors": Polled(node, CableState, "cable/state", _STREAM),
            "status": Polled(node, ControllerStatus, "controller/status", LATCHED),
            "truth": Polled(node, PoseArray, "truth/backbone", _STREAM),
            "forces": Polled(node, VirtualForces, "truth/forces", _STREAM),
            "load": Polled(node, WrenchEstimate, "estimated/wrench", _STREAM),
            "target": Polled(node, PoseStamped, "target", COMMAND),
            "shape": Polled(node, ShapeTarget, "target/shape", COMMAND),
        }
        rest = rest_backbone(robot)
        self._target = TargetView(rest.tip, rest)
        self._counted: tuple[float, int] | None = None
        self._rate = 0.0

    def destroy(self) -> None:
        """Unsubscribe."""
        for stream in self._streams.values():
            stream.destroy()

    def read(self) -> None:
        """Read the messages since the last call."""
        fresh = {name: stream.take() for name, stream in self._streams.items()}
        self._take_target(fresh["target"], fresh["shape"])
        self._measure_rate(fresh["deformation"])

    def snapshot(self, recording: str = "") -> Snapshot:
        """Return what the page shows; recording: path of the bag that is being recorded."""
        deformation, motors, status, truth = (self._current(name) for name in ("deformation", "motors", "status", "truth"))
        shown: dict = {}
        of_shape = self._misfit("robot/deformation", deformation, "cable_tension", "cable_displacement")
        of_motors = self._misfit("cable/state", motors, "tension")
        self.misfit = "; ".join(filter(None, (of_shape, of_motors)))
        if deformation and not of_shape:
            d = deformation.message
            shown.update(
                backbone=backbone_of(d), gravity=vector_of(d.gravity),
                tension=np.array(d.cable_tension), displacement=np.array(d.cable_displacement),
                model=d.model, model_time=d.solve_time)  # fmt: skip
            shown.update(model_touches=self._model_touches(d, shown["backbone"]))
        forces, load = self._current("forces"), self._current("load")
        if forces:
            shown.update(virtual_touches=_touches(forces.message), wall=_wall(forces.message))
        backbone = shown.get("backbone")  # None also where that of a message is not valid
        if load and backbone and np.isfinite(force := vector_of(load.message.wrench.force)).all():
            variance = np.trace(np.reshape(load.message.covariance, (6, 6))[:3, :3])
            shown.update(load=Touch("estimated", backbone.tip, force), load_deviation=float(np.sqrt(max(variance, 0.0))))
        if motors:
            m = motors.message
            shown.update(motors_state=_MOTOR_STATES.get(m.state, "?"), motors_message=m.message)
            if not of_motors:
                shown.update(motors_tension=np.array(m.tension))
        if self.misfit:
            shown.update(status=self.misfit, status_level="error")
        elif status:
            shown.update(status=_status_text(status.message), status_level=_LEVELS.get(status.message.code, "warn"))
        return Snapshot(
            time=time.monotonic(),
            truth=backbone_of_poses(truth.message) if truth else None,
            target=self._target,
            rate=self._rate,
            delays=self._delays(),
            recording=recording,
            virtual=self._sees_virtual_robot(),
            **shown,
        )

    def _misfit(self, topic: str, received: Received | None, *fields: str) -> str:
        """Return what is wrong with fields of a message that have a number for each cable; empty where nothing is."""
        for values in () if received is None else (getattr(received.message, field) for field in fields):
            if len(values) != self._cables:
                return f"{topic} has {len(values)} cables and is not shown; this robot has {self._cables}"
            if not np.isfinite(values).all():
                return f"{topic} has numbers that are not finite and is not shown"
        return ""

    def _sees_virtual_robot(self) -> bool:
        """Return whether a virtual robot runs.

        A recorder also subscribes to virtual/base_orientation, and a tracking system may publish truth/tip, but only the virtual
        robot subscribes to the first and publishes truth/gravity.
        """
        return self._node.count_subscribers("virtual/base_orientation") > 0 and self._node.count_publishers("truth/gravity") > 0

    def _current(self, name: str) -> Received | None:
        received = self._streams[name].last
        if received is None:
            return None
        # A latched status is valid until it is replaced.
        return received if name == "status" or time.time_ns() - received.sent < _STALE * 1e9 else None

    def _model_touches(self, message: Deformation, backbone: Backbone | None) -> tuple[Touch, ...]:
        """Return the forces of walls on the model; none where this node does not know the walls, or the message is not valid."""
        if self._walls is None or not message.contact_obstacle or backbone is None:
            return ()
        try:
            contact = contact_of(message)
        except ValueError:
            return ()  # the controller refuses it and reports it
        gravity, line = vector_of(message.gravity), backbone.position
        return model_touches(self._walls, gravity, contact.names, contact.force, contact.position, line)

    def _delays(self) -> dict[str, float]:
        """Return s from the IMU sample to the message of each stage."""
        delays = {}
        for stage, name in (("model", "deformation"), ("command", "command"), ("motors", "motors")):
            received = self._current(name)
            if received is None or (stage == "motors" and received.message.state != CableState.ACTIVE):
                continue
            delay = (received.sent - Time.from_msg(received.message.header.stamp).nanoseconds) * 1e-9
            if 0.0 <= delay < _CLOCK_TOLERANCE:
                delays[stage] = delay
        return delays

    def _measure_rate(self, fresh: Received | None) -> None:
        """Compute the model's rate (Hz) from the sequence numbers of its messages."""
        now = time.monotonic()
        if fresh is None:
            if self._current("deformation") is None:
                self._rate, self._counted = 0.0, None
            return
        if self._counted is None or fresh.number < self._counted[1]:
            self._counted = now, fresh.number
        elif now - self._counted[0] >= 1.0:
            self._rate = (fresh.number - self._counted[1]) / (now - self._counted[0])
            self._counted = now, fresh.number

    def _take_target(self, pose: Received | None, shape: Received | None) -> None:
        try:
            if pose:
                self._target = TargetView(pose_target(pose.message.pose, 1.0, 0.0).tip_position)
            if shape:
                target = shape_target(shape.message, self._length)
                bent = arc_backbone(self._length, shape.message.bend_angle, shape.message.bend_plane)
                self._target = TargetView(target.tip_position, bent if shape.message.bend else None)
        except TargetError:
            return  # the controller refuses it and reports it


def _touches(message: VirtualForces) -> tuple[Touch, ...]:
    return tuple(
        Touch(source, vector_of(place), vector_of(force))
        for source, place, force in zip(message.source, message.position, message.force)
    )


def _wall(message: VirtualForces) -> tuple[np.ndarray, np.ndarray] | None:
    return (vector_of(message.wall_point), vector_of(message.wall_normal)) if message.has_wall else None


def _status_text(status: ControllerStatus) -> str:
    """Return the sentence of the controller; if the target cannot be held, with the reason."""
    if status.holdable != Holdable.NO or status.code not in (ControllerStatus.AT_LIMIT, ControllerStatus.UNREACHABLE):
        return status.message
    return f"{status.message}; at start {status.hold_message}"
