"""Node inverse_controller: computes the cable displacements that bring the model to its target.

It solves one quadratic programme per deformation. At start a process of low priority finds out whether the cables can hold the
target against the gravity that acts then; the status contains its answer as soon as it is known. Where a tracker measures the
tip, the target is corrected by the model's error (`tracker_input`).
"""

import math
import sys
import time
from collections.abc import Callable

import numpy as np
from geometry_msgs.msg import PoseStamped
from gravcomp_node.local_topics import Adapted
from gravcomp_node.managed_node import ERROR, OK, WARN
from gravcomp_node.serialised_command import PublishedCommand
from std_msgs.msg import Header
from std_srvs.srv import SetBool, Trigger

from gravcomp.graph.parameters.inverse_controller import InverseControllerParameters
from gravcomp.holdability.background import HoldProcess
from gravcomp.inverse import Command, ControllerCode, Holdable, Target, TargetError, direction_weight, rest_target, warm_up
from gravcomp.inverse import InverseController as InverseProblem
from gravcomp_fem.conversion import point_message, pose_target, seconds, shape_target
from gravcomp_fem.deformed import Deformed, PublishedShape, from_message, from_shape
from gravcomp_fem.tracker_input import TrackerInput
from gravcomp_msgs.msg import CableCommand, ControllerStatus, Deformation, ShapeTarget
from gravcomp_node import COMMAND, LATCHED, SENSOR, ManagedNode, run

# The status is for the user, not for the loop. A change of the code is published immediately.
_STATUS_PERIOD = 0.1  # s
_REFUSAL_SHOWN = 5.0  # s
_INACTIVE = "the node is not active: activate it first"
_LEVELS = {
    ControllerCode.INACTIVE: OK,
    ControllerCode.OK: OK,
    ControllerCode.RELAXING: OK,
    ControllerCode.SOLVER_FAILED: ERROR,
}


class InverseController(ManagedNode):
    """Publishes the cable displacements that keep the target shape."""

    name = "inverse_controller"
    parameters_class = InverseControllerParameters

    def configure(self) -> None:
        """Compile the solver; create publishers and services."""
        file, transmission = self.robot_file, self.robot_file.hardware.transmission
        robot = file.robot
        self._problem = InverseProblem(robot, self.parameters.inverse, transmission, file.scene, file.zones)
        # Compile before the first deformation arrives.
        warm_up(robot, self.parameters.inverse, transmission, surrounded=bool(file.scene or file.zones))
        self._tracker = TrackerInput(self, robot, self.parameters.frame)
        self._target: Target | None = self._at_rest() if self.parameters.hold_straight else None
        self._enabled = self.parameters.enabled
        self._relaxing = False
        self._command = self.create_publisher(CableCommand, "cable/command", COMMAND)
        self._status = self.create_publisher(ControllerStatus, "controller/status", LATCHED)
        self._offered = [
            self.create_service(SetBool, "~/enable", self._on_enable),
            self.create_service(Trigger, "~/relax", self._on_relax),
        ]

    def activate(self) -> None:
        """Reset the problem and subscribe."""
        self._problem.reset()
        self._tracker.begin(self.parameters.tracker)
        self._last_stamp: float | None = None
        self._published_code, self._published_at = None, 0.0
        self._refusal, self._refused_at = "", -math.inf
        self._last_arrival = self.get_clock().now()
        self._holdable, self._hold_message = Holdable.NOT_KNOWN, ""
        self._question: HoldProcess | None = None
        self._asked = not self.parameters.check_hold
        self._inputs = [
            self.create_subscription(
                Deformation, "robot/deformation", self._on_deformation, SENSOR, takes=self._on_published_shape
            ),
            self.create_subscription(PoseStamped, "target", self._on_pose_target, COMMAND),
            self.create_subscription(ShapeTarget, "target/shape", self._on_shape_target, COMMAND),
            self._tracker.subscription(),
        ]
        self._watch = self.create_timer(0.5 * self.parameters.stale_after, self._check_stream)
        self._publish_code(ControllerCode.INACTIVE, "waiting for robot/deformation")

    def deactivate(self) -> None:
        """Unsubscribe; the motors hold."""
        for subscription in self._inputs:
            self.destroy_subscription(subscription)
        self.destroy_timer(self._watch)
        if self._question is not None:
            self._question.stop()
        self._refused_at = -math.inf
        self._publish_code(ControllerCode.INACTIVE, "not active")

    def cleanup(self) -> None:
        """Destroy services and publishers."""
        for service in self._offered:
            self.destroy_service(service)
        self.destroy_publisher(self._command)
        self.destroy_publisher(self._status)

    def parameters_changed(self, old: InverseControllerParameters, new: InverseControllerParameters) -> None:
        """Apply new options and a change of `enabled`."""
        if hasattr(self, "_problem"):
            self._problem.options = new.inverse
            if old.tracker != new.tracker:
                self._tracker.begin(new.tracker)
        if old.enabled != new.enabled:
            self._enabled, self._relaxing = new.enabled, False

    def _at_rest(self) -> Target:
        return rest_target(
            self.robot_file.robot,
            tip_position_weight=self.parameters.tip_position_weight,
            tip_direction_weight=self._direction_weight(),
        )

    def _direction_weight(self) -> float:
        return direction_weight(self.robot_file.robot.length, self.parameters.tip_direction_weight)

    # The loop.

    def _on_deformation(self, message: Deformation) -> None:
        self._take(message.status, message.message, message.header, lambda: from_message(message))
        self._last_arrival = self.get_clock().now()  # after the command, which the motors wait for

    def _on_published_shape(self, published: PublishedShape) -> None:
        self._take(published.shape.status, published.shape.message, published.header, lambda: from_shape(published))
        self._last_arrival = self.get_clock().now()

    def _take(self, status: int, sentence: str, header: Header, read: Callable[[], Deformed]) -> None:
        """Follow the deformation that `read` returns, which raises ValueError for one that is not valid."""
        if status == Deformation.FAILED:
            self._publish_code(ControllerCode.STALE, f"no command on a failed deformation: {sentence}", header)
            return
        try:
            deformed = read()
        except ValueError as error:
            self._publish_code(ControllerCode.REFUSED, f"robot/deformation refused: {error}", header)
            return
        if len(deformed.cable_tension) != len(self.robot_file.robot.cables):
            found, own = len(deformed.cable_tension), len(self.robot_file.robot.cables)
            self._publish_code(ControllerCode.REFUSED, f"robot/deformation has {found} cables; this robot has {own}", header)
            return
        self._follow(deformed)

    def _follow(self, deformed: Deformed) -> None:
        header = deformed.header
        self._check_hold(deformed.gravity)
        self._tracker.predict(deformed)
        interval = self._interval(header)
        if self._relaxing:
            command = self._problem.relax(deformed.response, interval=interval)
        elif self._enabled and self._target is not None:
            command = self._problem.step(
                deformed.response,
                self._tracker.corrected(self._target, header),
                backbone_station=deformed.backbone_station,
                tension=deformed.cable_tension,
                interval=interval,
                followed=deformed.status != Deformation.NOT_CONVERGED,
                contact=deformed.contact,
                gravity=deformed.gravity,
            )
        else:
            self._publish_code(ControllerCode.INACTIVE, "disabled" if not self._enabled else "waiting for a target", header)
            return
        sent = PublishedCommand(header, command.displacement, command.tension)
        self._command.publish(Adapted(sent, PublishedCommand.message, PublishedCommand.serialised))
        self._publish_status(command, header)

    def _interval(self, header: Header) -> float:
        """Return s between the stamps of this and the last deformation; 0.01 when the stamp has not increased."""
        stamp = seconds(header)
        interval = 0.01 if self._last_stamp is None else stamp - self._last_stamp
        self._last_stamp = stamp
        return interval if interval > 0.0 else 0.01

    def _check_hold(self, gravity: np.ndarray) -> None:
        """Ask once whether the target can be held against the gravity of a deformation, and take the answer when it is there."""
        if not self._asked and self._target is not None and self._target.tip_position_weight > 0.0:
            self._asked = True
            if np.linalg.norm(gravity) > 0.0 and self.robot_file.robot.cables:
                self._question = HoldProcess(self.robot_file.robot, gravity, self._target)
        if self._question is None or self._question.running:
            return
        verdict = self._question.poll()
        self._question = None
        if verdict is None:
            self._hold_message = "not known: the process that finds it out has failed"
            self.get_logger().warning(f"whether the cables can hold the target is {self._hold_message}")
            return
        self._holdable, self._hold_message = (Holdable.YES if verdict.held else Holdable.NO), verdict.sentence
        log = self.get_logger()
        (log.info if verdict.held else log.warning)(f"in the direction of gravity at start {verdict.sentence}")

    def _check_stream(self) -> None:
        silence = (self.get_clock().now() - self._last_arrival).nanoseconds * 1e-9
        if silence > self.parameters.stale_after:
            # The rate limit restarts at the last displacements, which the bridge holds.
            self._last_stamp = None
            self._publish_code(ControllerCode.STALE, f"no robot/deformation for {silence:.1f} s: no command is sent")

    # Targets and services.

    def _on_pose_target(self, message: PoseStamped) -> None:
        weights = self.parameters.tip_position_weight, self._direction_weight()
        self._take_target(message.header, lambda: pose_target(message.pose, *weights))

    def _on_shape_target(self, message: ShapeTarget) -> None:
        self._take_target(message.header, lambda: shape_target(message, self.robot_file.robot.length))

    def _take_target(self, header: Header, make: Callable[[], Target]) -> None:
        if header.frame_id not in ("", self.parameters.frame):
            self._refuse(
                f"the target is in the frame '{header.frame_id}'; '{self.parameters.frame}' is needed; the last one is kept"
            )
            return
        try:
            target = make()
            target.check_reach(self.robot_file.robot.length)
            self._target = target
        except TargetError as error:
            self._refuse(f"target refused: {error}; the last one is kept")

    def _refuse(self, sentence: str) -> None:
        """Publish the refusal, and keep showing it for some seconds."""
        self._refusal, self._refused_at = sentence, time.monotonic()
        self.get_logger().warning(sentence, throttle_duration_sec=1.0)
        self._publish_code(ControllerCode.REFUSED, sentence)

    def _on_enable(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        if not self.is_active:
            response.message = _INACTIVE
            return response
        self._enabled, self._relaxing = request.data, False
        response.success = True
        response.message = "compensating" if request.data else "no commands are sent; the motors hold"
        return response

    def _on_relax(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if not self.is_active:
            response.message = _INACTIVE
            return response
        self._relaxing = True
        response.success, response.message = True, "paying the cables out until ~/enable is called"
        return response

    # Status.

    def _publish_status(self, command: Command, header: Header) -> None:
        code, message = self._with_refusal(command.code, command.message)
        level = _LEVELS.get(code, WARN)
        tracker, values = self._tracker.report()
        if tracker:
            message, level = f"{message}; {tracker}", max(level, WARN)
        self.report(level, message, solve_time_us=round(1e6 * command.solve_time), **values)
        stamp = seconds(header)
        if code == self._published_code and 0.0 <= stamp - self._published_at < _STATUS_PERIOD:
            return
        self._published_code, self._published_at = code, stamp
        status = ControllerStatus(
            header=header,
            code=int(code),
            message=message,
            distance=float(command.distance),
            lateral=float(command.lateral),
            axial=float(command.axial),
            tilt=float(command.tilt),
            solve_time=float(command.solve_time),
            holdable=int(self._holdable),
            hold_message=self._hold_message,
            nearest_tip=point_message(command.tip),
        )
        if len(command.forces):
            strongest = command.forces.largest
            status.contact_obstacle = command.forces.names[strongest]
            status.contact_force = float(command.forces.force[strongest])
            status.contact_position = point_message(command.forces.position[strongest])
        self._status.publish(status)

    def _with_refusal(self, code: ControllerCode, sentence: str) -> tuple[ControllerCode, str]:
        """Return the status to publish: a refusal stays visible for a while, also together with a repeated other status."""
        if time.monotonic() - self._refused_at > _REFUSAL_SHOWN or self._refusal in sentence:
            return code, sentence
        if code in (ControllerCode.STALE, ControllerCode.INACTIVE, ControllerCode.SOLVER_FAILED):
            return code, f"{sentence}; {self._refusal}"
        return ControllerCode.REFUSED, self._refusal

    def _publish_code(self, code: ControllerCode, sentence: str, header: Header | None = None) -> None:
        code, sentence = self._with_refusal(code, sentence)
        status = ControllerStatus(code=int(code), message=sentence, holdable=int(self._holdable), hold_message=self._hold_message)
        status.header.stamp = header.stamp if header else self.get_clock().now().to_msg()
        self._published_code = None
        self._status.publish(status)
        self.report(_LEVELS.get(code, WARN), sentence)


def main() -> int:
    """Run the node; return the exit code."""
    return run(InverseController)


if __name__ == "__main__":
    sys.exit(main())
