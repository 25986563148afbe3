"""The user's requests on the page as messages, service calls and a recorder process."""

import tempfile
from datetime import datetime
from pathlib import Path
from typing import Any, Protocol

from geometry_msgs.msg import QuaternionStamped
from rclpy.lifecycle import LifecycleNode
from rclpy.qos import QoSProfile, ReliabilityPolicy
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger

from gravcomp.graph.parameters.viewer import ViewerParameters
from gravcomp.inverse import direction_weight
from gravcomp.launcher import LaunchError, NodeProcess, NodeSpec
from gravcomp.view import requests
from gravcomp.virtual.motion import base_orientation, quaternion
from gravcomp_fem.conversion import bend_message
from gravcomp_msgs.msg import ShapeTarget
from gravcomp_node import COMMAND

_SERVICES = {
    "inverse_controller/enable": SetBool,
    "inverse_controller/relax": Trigger,
}


class Notify(Protocol):
    """Shows a title and a sentence on the page."""

    def __call__(self, title: str, sentence: str, *, good: bool = False) -> None:
        """Show it; good: it reports a success."""


class RequestSender:
    """Sends requests; reports answers and failures with `notify`.

    Attributes: shape_target, base, fault, hand, wall (publishers), services (clients by name), recorder (its process, or None).
    """

    def __init__(
        self, node: LifecycleNode, parameters: ViewerParameters, length: float, notify: Notify, bridge: str = "can_bridge"
    ):
        """length: of the robot in m; bridge: name of the node that drives its motors."""
        self._node, self._parameters, self.notify = node, parameters, notify
        self._weight = direction_weight(length, parameters.tip_direction_weight)
        self.shape_target = node.create_publisher(ShapeTarget, "target/shape", COMMAND)
        self.base = node.create_publisher(QuaternionStamped, "virtual/base_orientation", COMMAND)
        faults = QoSProfile(reliability=ReliabilityPolicy.RELIABLE, depth=20)
        self.fault = node.create_publisher(String, "virtual/fault", faults)
        self.hand = node.create_publisher(String, "virtual/hand", COMMAND)
        self.wall = node.create_publisher(String, "virtual/wall", COMMAND)
        self._bridge = bridge
        kinds = {**_SERVICES, **{f"{bridge}/{name}": Trigger for name in requests.SERVICES}}
        self.services = {name: node.create_client(kind, name) for name, kind in kinds.items()}
        self.recorder: NodeProcess | None = None
        self._bag = ""

    def destroy(self) -> None:
        """Destroy publishers and clients."""
        for publisher in (self.shape_target, self.base, self.fault, self.hand, self.wall):
            self._node.destroy_publisher(publisher)
        for client in self.services.values():
            self._node.destroy_client(client)

    def send(self, request: requests.Request) -> None:
        """Send one request."""
        match request:
            case requests.SetTarget(angle, plane):
                message = bend_message(angle, plane, self._weight, self._parameters.frame)
                message.header.stamp = self._node.get_clock().now().to_msg()
                self.shape_target.publish(message)
            case requests.TiltBase(inclination, roll):
                self._tilt(inclination, roll)
            case requests.InjectFault(text):
                self.fault.publish(String(data=text))
            case requests.Push(place):
                self.hand.publish(String(data="release" if place is None else f"{{place_mm: {_in_mm(place)}}}"))
            case requests.PlaceWall(None):
                self.wall.publish(String(data="clear"))
            case requests.PlaceWall((point, normal)):
                wall = f"{{name: unknown wall, point_mm: {_in_mm(point)}, normal: {[float(f'{n:.6f}') for n in normal]}}}"
                self.wall.publish(String(data=wall))
            case requests.Compensate("relax"):
                self._call("inverse_controller/relax", Trigger.Request())
            case requests.Compensate(mode):
                self._call("inverse_controller/enable", SetBool.Request(data=mode == "compensate"))
            case requests.BridgeService(name):
                self._call(f"{self._bridge}/{name}", Trigger.Request())
            case requests.Record(True):
                self._start_recording()
            case requests.Record(False):
                self.stop_recording()

    def current_bag(self) -> str:
        """Return the path of the bag that is being recorded, or ''; report a recorder that has ended by itself."""
        if self.recorder and self.recorder.exit_code is not None:
            self.notify("Recording ended", self.recorder.why())
            self.recorder = None
        return self._bag if self.recorder else ""

    def stop_recording(self) -> None:
        """End a recording, if there is one."""
        if self.recorder:
            self.recorder.stop()
            self.recorder = None
            self.notify("Recorded", self._bag, good=True)

    def _start_recording(self) -> None:
        if self.recorder:
            return
        bag = Path(self._parameters.bag_folder or ".").resolve() / f"gravcomp_{datetime.now():%Y%m%d_%H%M%S}"
        spec = NodeSpec("gravcomp_fem", "recorder", {"out": str(bag)}, self._node.get_namespace().rstrip("/"))
        try:
            self.recorder = NodeProcess(spec, Path(tempfile.gettempdir()) / f"{bag.name}.log")
        except (LaunchError, OSError) as error:
            self.notify("Not recording", str(error))
            return
        self._bag = str(bag)

    def _tilt(self, inclination: float, roll: float) -> None:
        message = QuaternionStamped()
        message.header.stamp = self._node.get_clock().now().to_msg()
        q = message.quaternion
        q.x, q.y, q.z, q.w = map(float, quaternion(base_orientation(inclination, roll)))
        self.base.publish(message)

    def _call(self, name: str, request: Any) -> None:
        client = self.services[name]
        if not client.service_is_ready():
            self.notify(name, "this service is not available: the node is not running")
            return
        client.call_async(request).add_done_callback(lambda future: self._show_answer(name, future.result()))

    def _show_answer(self, name: str, answer: Any) -> None:
        self.notify(name, answer.message or "done", good=answer.success)


def _in_mm(place: requests.Triple) -> list[float]:
    return [round(1e3 * x, 4) for x in place]
