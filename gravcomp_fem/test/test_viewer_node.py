"""The viewer sends the user's requests as messages, service calls and recordings, and reports a missing node."""

import os
import time

os.environ.setdefault("ROS_DOMAIN_ID", str(100 + os.getpid() % 100))

import numpy as np
import pytest
import rclpy
import yaml
from geometry_msgs.msg import Point, QuaternionStamped, Vector3, Vector3Stamped
from gravcomp_fem.viewer import Viewer
from rclpy.executors import SingleThreadedExecutor
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger

from gravcomp.commands.record import describe
from gravcomp.view.requests import BridgeService, Compensate, InjectFault, PlaceWall, Push, Record, SetTarget, TiltBase
from gravcomp.virtual.faults import Fault
from gravcomp.virtual.motion import base_orientation, rotation_from_quaternion
from gravcomp.virtual.placed_wall import parse_wall
from gravcomp_msgs.msg import CableState, Deformation, ShapeTarget, VirtualForces, WrenchEstimate
from gravcomp_node import COMMAND, SENSOR


class Stand:
    """The viewer and, if `whole`, simulated partners; `heard`: what they received by topic or service."""

    def __init__(self, folder, whole: bool = True):
        rclpy.init(args=["test", "--ros-args", "-p", "port:=8870", "-p", f"bag_folder:={folder}", "-p", "rate:=20.0"])
        self.executor = SingleThreadedExecutor()
        self.viewer = Viewer()
        self.other = rclpy.create_node("other", use_global_arguments=False)
        self.heard: dict[str, list] = {}
        self.notified: list[tuple] = []
        if whole:
            for kind, topic in (
                (ShapeTarget, "target/shape"),
                (QuaternionStamped, "virtual/base_orientation"),
                (String, "virtual/fault"),
                (String, "virtual/hand"),
                (String, "virtual/wall"),
            ):
                self.other.create_subscription(kind, topic, lambda m, t=topic: self.heard.setdefault(t, []).append(m), COMMAND)
            for name in ("inverse_controller/relax", "can_bridge/home", "can_bridge/stop"):
                self.other.create_service(Trigger, name, lambda q, a, n=name: self._serve(n, None, a))
            self.other.create_service(
                SetBool, "inverse_controller/enable", lambda q, a: self._serve("inverse_controller/enable", q.data, a)
            )
        for node in (self.viewer, self.other):
            self.executor.add_node(node)
        self.viewer.start()
        # There is no browser: keep the notifications here.
        self.viewer.sender.notify = lambda title, sentence, good=False: self.notified.append((title, sentence, good))

    def _serve(self, name, value, answer):
        self.heard.setdefault(name, []).append(value)
        answer.success, answer.message = True, "done as requested"
        return answer

    def ask(self, request) -> None:
        """Put a request into the queue, as a control of the page does."""
        self.viewer._page._controls._requests.put(request)

    def until(self, done, what):
        end = time.monotonic() + 60.0
        while not done():
            assert time.monotonic() < end, what
            self.executor.spin_once(timeout_sec=0.05)

    def close(self):
        self.viewer.shut_down()
        self.viewer.destroy_node()
        self.other.destroy_node()
        rclpy.shutdown()


@pytest.fixture
def stand(tmp_path):
    stand = Stand(tmp_path)
    publishers = (stand.viewer.sender.shape_target, stand.viewer.sender.base, stand.viewer.sender.fault)
    stand.until(lambda: all(p.get_subscription_count() for p in publishers), "the viewer has no subscribers")
    stand.until(
        lambda: all(c.service_is_ready() for n, c in stand.viewer.sender.services.items() if n != "can_bridge/release"),
        "no services",
    )
    yield stand
    stand.close()


def test_a_bend_becomes_a_target(stand):
    stand.ask(SetTarget(0.7, -1.2))
    stand.until(lambda: "target/shape" in stand.heard, "no target")
    (message,) = stand.heard["target/shape"]
    assert message.bend and (message.bend_angle, message.bend_plane) == (0.7, -1.2)
    assert message.header.frame_id == "soft_base" and message.tip_position_weight == 1.0


def test_a_recorder_alone_is_not_taken_for_a_virtual_robot(stand):
    """A recorder subscribes to every topic; on hardware the page must not offer to tilt the base because of it."""
    assert stand.viewer.sender.base.get_subscription_count() > 0
    assert not stand.viewer.observer.snapshot().virtual
    stand.other.create_publisher(Vector3Stamped, "truth/gravity", 10)
    stand.until(lambda: stand.viewer.observer.snapshot().virtual, "the virtual robot is not seen")


def test_the_last_of_many_tilts_turns_the_base(stand):
    for degrees in range(0, 60):
        stand.ask(TiltBase(np.radians(degrees), 0.3))
    wanted = base_orientation(np.radians(59.0), 0.3)

    def arrived() -> bool:
        q = stand.heard["virtual/base_orientation"][-1].quaternion if "virtual/base_orientation" in stand.heard else None
        return q is not None and np.allclose(rotation_from_quaternion(q.x, q.y, q.z, q.w), wanted, atol=1e-9)

    stand.until(arrived, "the last tilt has not come")
    # A dragged slider gives one message per frame.
    assert len(stand.heard["virtual/base_orientation"]) < 60


@pytest.mark.parametrize(
    ("request_", "service", "value"),
    [
        (Compensate("compensate"), "inverse_controller/enable", True),
        (Compensate("hold"), "inverse_controller/enable", False),
        (Compensate("relax"), "inverse_controller/relax", None),
        (BridgeService("home"), "can_bridge/home", None),
        (BridgeService("stop"), "can_bridge/stop", None),
    ],
)
def test_compensation_and_motors_are_requested_and_the_answer_is_shown(stand, request_, service, value):
    stand.ask(request_)
    stand.until(lambda: stand.notified, "no answer")
    assert stand.heard == {service: [value]}
    assert stand.notified == [(service, "done as requested", True)]


def test_a_fault_is_published_as_yaml_of_the_virtual_robot(stand):
    stand.ask(InjectFault("{kind: stall, cable: s1c2, duration: 2}"))
    stand.until(lambda: "virtual/fault" in stand.heard, "no fault")
    fault = Fault.parse(yaml.safe_load(stand.heard["virtual/fault"][0].data), "page")
    assert (fault.kind, fault.cable, fault.duration) == ("stall", "s1c2", 2.0)


def test_hand_and_wall_are_published_as_yaml_of_the_virtual_robot(stand):
    stand.ask(Push((0.02, 0.0, 0.095)))
    stand.ask(PlaceWall(((-0.03, 0.0, 0.0), (1.0, 0.0, 0.0))))
    stand.until(lambda: {"virtual/hand", "virtual/wall"} <= set(stand.heard), "no hand, or no wall")
    assert yaml.safe_load(stand.heard["virtual/hand"][0].data) == {"place_mm": [20.0, 0.0, 95.0]}
    wall = parse_wall(yaml.safe_load(stand.heard["virtual/wall"][0].data), "page", 0.1, 0.0045)
    assert (wall.name, wall.point, wall.normal) == ("unknown wall", (-0.03, 0.0, 0.0), (1.0, 0.0, 0.0))
    stand.ask(Push(None))
    stand.ask(PlaceWall(None))
    stand.until(lambda: len(stand.heard["virtual/hand"]) == len(stand.heard["virtual/wall"]) == 2, "not let go")
    assert (stand.heard["virtual/hand"][1].data, stand.heard["virtual/wall"][1].data) == ("release", "clear")


def test_forces_on_the_virtual_robot_are_shown(stand):
    forces = stand.other.create_publisher(VirtualForces, "truth/forces", SENSOR)
    message = VirtualForces(source=["slab"], position=[Point(z=0.1)], force=[Vector3(x=0.02)], has_wall=True)
    message.wall_normal.x = 1.0

    def shown() -> bool:
        forces.publish(message)
        return bool(stand.viewer.observer.snapshot().virtual_touches)

    stand.until(shown, "no force")
    snapshot = stand.viewer.observer.snapshot()
    (touch,) = snapshot.virtual_touches
    assert touch.source == "slab" and touch.force[0] == 0.02 and touch.place[2] == 0.1
    assert snapshot.wall is not None and snapshot.wall[1][0] == 1.0


def test_a_load_is_shown_at_the_tip_and_nowhere_without_a_valid_backbone(stand):
    shapes = stand.other.create_publisher(Deformation, "robot/deformation", SENSOR)
    loads = stand.other.create_publisher(WrenchEstimate, "estimated/wrench", SENSOR)
    load, shape = WrenchEstimate(), Deformation(model="full", backbone_station=[0.0])
    load.wrench.force.x = 0.03
    shape.cable_tension = shape.cable_displacement = [0.0] * len(stand.viewer.robot_file.robot.cables)

    def is_shown(is_done):
        shapes.publish(shape)
        loads.publish(load)
        return is_done(stand.viewer.observer.snapshot())

    stand.until(lambda: is_shown(lambda shown: shown.model == "full"), "no shape")
    for _ in range(5):
        assert is_shown(lambda shown: shown.backbone is None and shown.load is None)
        stand.executor.spin_once(timeout_sec=0.05)
    shape.backbone_station, shape.backbone_position = [0.0, 1.0], [0.0, 0.0, 0.0, 0.0, 0.0, 0.1]
    shape.backbone_orientation = [0.0, 0.0, 0.0, 1.0] * 2
    stand.until(lambda: is_shown(lambda shown: shown.load is not None), "no load")
    touch = stand.viewer.observer.snapshot().load
    assert touch.place.tolist() == [0.0, 0.0, 0.1] and touch.force.tolist() == [0.03, 0.0, 0.0]


def test_messages_of_another_robot_are_named_and_not_shown(stand):
    shapes = stand.other.create_publisher(Deformation, "robot/deformation", SENSOR)
    states = stand.other.create_publisher(CableState, "cable/state", SENSOR)
    own = len(stand.viewer.robot_file.robot.cables)

    def is_shown(cables, is_done):
        shapes.publish(Deformation(cable_tension=[0.1] * cables, cable_displacement=[0.0] * cables))
        states.publish(CableState(state=CableState.ACTIVE, tension=[0.1] * cables))
        return is_done(stand.viewer.observer.snapshot())

    other = f"robot/deformation has {own + 1} cables and is not shown; this robot has {own}; cable/state has {own + 1} cables"
    stand.until(lambda: is_shown(own + 1, lambda shown: shown.status.startswith(other)), "the other robot is not named")
    snapshot = stand.viewer.observer.snapshot()
    assert snapshot.status_level == "error" and snapshot.tension is None and snapshot.motors_tension is None
    broken = Deformation(cable_tension=[np.nan] * own, cable_displacement=[0.0] * own)
    stand.until(lambda: (shapes.publish(broken), "not finite" in stand.viewer.observer.snapshot().status)[1], "NaN is not named")
    stand.until(lambda: is_shown(own, lambda shown: shown.tension is not None), "the node does not go on")
    assert stand.viewer.observer.misfit == ""


def test_the_button_records_a_bag(stand, tmp_path):
    stand.ask(Record(True))
    stand.until(lambda: stand.viewer.sender.recorder is not None, "no recorder")
    log = stand.viewer.sender.recorder.log
    stand.until(lambda: "recording into" in log.read_text(encoding="utf-8"), "the recorder does not start")
    end = time.monotonic() + 2.0
    stand.until(lambda: time.monotonic() > end, "")
    stand.ask(Record(False))
    stand.until(lambda: any(title == "Recorded" for title, *_ in stand.notified), "the recorder does not end")
    (bag,) = tmp_path.glob("gravcomp_*")
    assert describe(bag)["topics"].get("/diagnostics", 0) > 0


def test_a_missing_node_is_reported(tmp_path):
    stand = Stand(tmp_path, whole=False)
    try:
        stand.ask(Compensate("compensate"))
        stand.until(lambda: stand.notified, "no notification")
        title, sentence, good = stand.notified[0]
        assert title == "inverse_controller/enable" and "not running" in sentence and not good
        # There is no virtual robot: its controls stay hidden.
        stand.until(lambda: not stand.viewer._page._controls._virtual.visible, "the base's controls are shown")
    finally:
        stand.close()
