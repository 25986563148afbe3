"""viewer: the live 3D page of a robot, and what people ask for there as messages and service calls.

It looks at the newest message of each topic at the page's rate and leaves all others to the middleware, in a process of its own: the
loop does not notice it. Nothing of the loop depends on it.
"""

import sys
import tempfile
import time
from datetime import datetime
from pathlib import Path

import numpy as np
from geometry_msgs.msg import PoseArray, PoseStamped, QuaternionStamped
from gravcomp_node.managed_node import OK
from gravcomp_node.polled import Polled, Received
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.time import Time
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger

from gravcomp.graph.parameters.viewer import ViewerParameters
from gravcomp.inverse import Target, TargetError
from gravcomp.launcher import LaunchError, NodeProcess, NodeSpec
from gravcomp.view import requests
from gravcomp.view.backbone import arc_backbone
from gravcomp.view.page import Page
from gravcomp.view.snapshot import Snapshot, TargetView
from gravcomp.virtual.motion import base_orientation, quaternion
from gravcomp_fem.conversion import backbone_of, backbone_of_poses, bend_message, pose_target, shape_target
from gravcomp_msgs.msg import CableCommand, CableState, ControllerStatus, Deformation, ShapeTarget
from gravcomp_node import COMMAND, LATCHED, ManagedNode, run

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
# Silent for longer, a stream is not shown any more.
_STALE = 1.0  # s
# A stamp farther from this clock comes from another one: a bag's, or another machine's.
_CLOCK_TOLERANCE = 10.0  # s


class Viewer(ManagedNode):
    """Shows the robot in a browser."""

    name = "viewer"
    parameters_class = ViewerParameters

    def configure(self) -> None:
        self._page = Page(self.robot_file.robot, self.parameters)
        self._shape_target = self.create_publisher(ShapeTarget, "target/shape", COMMAND)
        self._base = self.create_publisher(QuaternionStamped, "virtual/base_orientation", COMMAND)
        self._fault = self.create_publisher(String, "virtual/fault", QoSProfile(reliability=ReliabilityPolicy.RELIABLE, depth=20))
        self._remote = {
            name: self.create_client(SetBool if name.endswith("enable") else Trigger, name)
            for name in (
                "inverse_controller/enable",
                "inverse_controller/relax",
                "can_bridge/home",
                "can_bridge/stop",
                "can_bridge/release",
            )
        }
        self.get_logger().info(f"the page is at {self._page.address}")

    def activate(self) -> None:
        length = self.robot_file.robot.length
        self._streams = {
            "deformation": Polled(self, Deformation, "robot/deformation", _STREAM),
            "command": Polled(self, CableCommand, "cable/command", _STREAM),
            "motors": Polled(self, CableState, "cable/state", _STREAM),
            "status": Polled(self, ControllerStatus, "controller/status", LATCHED),
            "truth": Polled(self, PoseArray, "truth/backbone", _STREAM),
            "target": Polled(self, PoseStamped, "target", COMMAND),
            "shape": Polled(self, ShapeTarget, "target/shape", COMMAND),
        }
        self._target = TargetView(np.array([0.0, 0.0, length]), arc_backbone(length, 0.0, 0.0))
        self._counted: tuple[float, int] | None = None
        self._rate = 0.0
        self._recorder: NodeProcess | None = None
        self._bag = ""
        self._frames = self.create_timer(1.0 / self.parameters.rate, self._frame)

    def deactivate(self) -> None:
        self.destroy_timer(self._frames)
        self._record(False)
        for stream in self._streams.values():
            stream.destroy()

    def cleanup(self) -> None:
        if not hasattr(self, "_page"):
            return
        self._page.close()
        del self._page
        for publisher in (self._shape_target, self._base, self._fault):
            self.destroy_publisher(publisher)
        for client in self._remote.values():
            self.destroy_client(client)

    def _frame(self) -> None:
        for request in self._page.requests():
            self._carry_out(request)
        fresh = {name: stream.take() for name, stream in self._streams.items()}
        self._take_target(fresh["target"], fresh["shape"])
        self._count(fresh["deformation"])
        self._page.show(self._snapshot())
        self.report(OK, f"the page is at {self._page.address}", browsers=self._page.clients)

    # What is shown.

    def _snapshot(self) -> Snapshot:
        deformation, motors, status, truth = (self._current(name) for name in ("deformation", "motors", "status", "truth"))
        shown: dict = {}
        if deformation:
            d = deformation.message
            shown.update(
                backbone=backbone_of(d), gravity=np.array([d.gravity.x, d.gravity.y, d.gravity.z]),
                tension=np.array(d.cable_tension), displacement=np.array(d.cable_displacement),
                model=d.model, model_time=d.solve_time)  # fmt: skip
        if motors:
            shown.update(motors_tension=np.array(motors.message.tension), motors_state=_MOTOR_STATES.get(motors.message.state, "?"),
                         motors_message=motors.message.message)  # fmt: skip
        if status:
            shown.update(status=status.message.message, status_level=_LEVELS.get(status.message.code, "warn"))
        if self._recorder and self._recorder.exit_code is not None:
            self._page.notify("Recording ended", self._recorder.why())
            self._recorder = None
        return Snapshot(
            time=time.monotonic(),
            truth=backbone_of_poses(truth.message) if truth else None,
            target=self._target,
            rate=self._rate,
            delays=self._delays(),
            recording=self._bag if self._recorder else "",
            virtual=self._sees_virtual_robot(),
            **shown,
        )

    def _sees_virtual_robot(self) -> bool:
        """Recorders listen to its topics as well, and a tracker may tell the true tip; but nobody else does this and knows the true gravity."""
        return self._base.get_subscription_count() > 0 and self.count_publishers("truth/gravity") > 0

    def _current(self, name: str) -> Received | None:
        received = self._streams[name].last
        if received is None:
            return None
        # A latched status holds until it is replaced.
        return received if name == "status" or time.time_ns() - received.sent < _STALE * 1e9 else None

    def _delays(self) -> dict[str, float]:
        """From the IMU sample to when each stage spoke of it."""
        delays = {}
        for stage, name in (("model", "deformation"), ("command", "command"), ("motors", "motors")):
            received = self._current(name)
            if received is None or (stage == "motors" and received.message.state != CableState.ACTIVE):
                continue
            delay = (received.sent - Time.from_msg(received.message.header.stamp).nanoseconds) * 1e-9
            if 0.0 <= delay < _CLOCK_TOLERANCE:
                delays[stage] = delay
        return delays

    def _count(self, fresh: Received | None) -> None:
        """The model's rate, from the numbers that the middleware gives its messages."""
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
        length = self.robot_file.robot.length
        try:
            if pose:
                self._target = TargetView(pose_target(pose.message.pose, 1.0, 0.0).tip_position)
            if shape:
                target: Target = shape_target(shape.message, length)
                bent = arc_backbone(length, shape.message.bend_angle, shape.message.bend_plane) if shape.message.bend else None
                self._target = TargetView(target.tip_position, bent)
        except TargetError:
            return  # the controller refuses it and says so

    # What people ask for.

    def _carry_out(self, request: requests.Request) -> None:
        match request:
            case requests.SetTarget(angle, plane):
                message = bend_message(angle, plane, self.parameters.tip_direction_weight, self.parameters.frame)
                message.header.stamp = self.get_clock().now().to_msg()
                self._shape_target.publish(message)
            case requests.TiltBase(inclination, roll):
                message = QuaternionStamped()
                message.header.stamp = self.get_clock().now().to_msg()
                q = message.quaternion
                q.x, q.y, q.z, q.w = map(float, quaternion(base_orientation(inclination, roll)))
                self._base.publish(message)
            case requests.InjectFault(text):
                self._fault.publish(String(data=text))
            case requests.Compensate("relax"):
                self._call("inverse_controller/relax", Trigger.Request())
            case requests.Compensate(mode):
                self._call("inverse_controller/enable", SetBool.Request(data=mode == "compensate"))
            case requests.BridgeService(name):
                self._call(f"can_bridge/{name}", Trigger.Request())
            case requests.Record(on):
                self._record(on)

    def _call(self, name: str, request) -> None:
        client = self._remote[name]
        if not client.service_is_ready():
            self._page.notify(name, "nobody offers this service: the node is not running")
            return
        client.call_async(request).add_done_callback(lambda future: self._answered(name, future.result()))

    def _answered(self, name: str, answer) -> None:
        self._page.notify(name, answer.message or "done", good=answer.success)

    def _record(self, on: bool) -> None:
        if not on:
            if self._recorder:
                self._recorder.stop()
                self._recorder = None
                self._page.notify("Recorded", self._bag, good=True)
            return
        if self._recorder:
            return
        bag = Path(self.parameters.bag_folder or ".").resolve() / f"gravcomp_{datetime.now():%Y%m%d_%H%M%S}"
        spec = NodeSpec("gravcomp_fem", "recorder", {"out": str(bag)}, self.get_namespace().rstrip("/"))
        try:
            self._recorder = NodeProcess(spec, Path(tempfile.gettempdir()) / f"{bag.name}.log")
        except (LaunchError, OSError) as error:
            self._page.notify("Not recording", str(error))
            return
        self._bag = str(bag)


def main() -> int:
    return run(Viewer)


if __name__ == "__main__":
    sys.exit(main())
