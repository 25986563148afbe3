"""External loads of fem_simulator: external/wrench, a payload that changes, and an unknown load that is found.

Known loads come on external/wrench and with the parameter payload_mass_g. An unknown one is estimated from measured/tip and
measured/tension, and published on estimated/wrench.
"""

from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped, WrenchStamped
from gravcomp_node.array_fields import doubles
from gravcomp_node.polled import Polled
from rclpy.lifecycle import LifecycleNode
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from std_srvs.srv import Trigger

from gravcomp.description import Robot
from gravcomp.external_loads import LivePayload, WrenchInput
from gravcomp.full_model.robot_model import RobotModel
from gravcomp.full_model.wrench import Wrench
from gravcomp.graph.parameters.fem_simulator import FemSimulatorParameters
from gravcomp.load_estimation import AnchoredProcess, LoadEstimate, LoadObserver, has_anchored_model
from gravcomp.mechanics.block_matrix import NotPositiveDefinite
from gravcomp.scene.scene import Scene
from gravcomp.simulation import DynamicSimulator, Shape, Simulator
from gravcomp_fem.conversion import seconds, vector_of
from gravcomp_msgs.msg import WrenchEstimate
from gravcomp_node import SENSOR

_COMPLIANCE_EVERY = 10  # samples between two computations of the tip's compliance
_FARTHEST = 2.0  # s between the stamps of a measurement and of gravity: what is farther is of another clock


class LoadInputs:
    """The loads of `node`'s robot."""

    def __init__(
        self,
        node: LifecycleNode,
        robot: Robot,
        parameters: FemSimulatorParameters,
        model: RobotModel,
        scene: Scene | None,
        holdable: float,
    ):
        """model: of the robot, as the simulator has it; scene: what it touches; holdable: payload in kg that the cables hold."""
        self._node, self._robot, self._model, self._scene = node, robot, model, scene
        self._frames = parameters.base_frame, parameters.tip_frame
        self.payload = LivePayload(robot, parameters.external.ramp_time, holdable)
        self._publisher = node.create_publisher(WrenchEstimate, "estimated/wrench", SENSOR)
        self._service = node.create_service(Trigger, "~/zero_load", self._on_zero)
        self._begin_wrenches(parameters)
        self._observer: LoadObserver | None = None
        self._begin_observer(parameters)
        self._set_payload(parameters)

    def change(self, old: FemSimulatorParameters, new: FemSimulatorParameters) -> None:
        """Apply new parameters; what they do not concern goes on. Raises ConfigError for a payload that is too heavy."""
        self._set_payload(new)
        if new.external != old.external:
            self._begin_wrenches(new)
        if new.load != old.load:
            self._begin_observer(new)

    def _set_payload(self, parameters: FemSimulatorParameters) -> None:
        wanted = self._robot.payload.mass if parameters.payload_mass < 0.0 else parameters.payload_mass
        self.payload.ramp_time = parameters.external.ramp_time
        self.payload.set(wanted)

    def _begin_wrenches(self, parameters: FemSimulatorParameters) -> None:
        self._wrenches = WrenchInput(self._robot, parameters.external, *self._frames)

    def _begin_observer(self, parameters: FemSimulatorParameters) -> None:
        self._end_observer()
        kind = parameters.load.kind
        if kind != "none":
            anchored = has_anchored_model(self._model, kind)
            worker = AnchoredProcess(self._model.robot, self._scene) if anchored else None
            self._observer = LoadObserver(self._robot, parameters.load, worker)
        self._samples, self._compliance = 0, np.zeros((3, 3))

    def _end_observer(self) -> None:
        if self._observer is not None:
            self._observer.close()
        self._observer = None

    def begin(self) -> None:
        """Subscribe, without any load."""
        self._wrenches.reset()
        if self._observer is not None:
            self._observer.reset()
        self._samples = 0
        self._refusals: dict[str, str] = {}
        self._subscription = self._node.create_subscription(WrenchStamped, "external/wrench", self._on_wrench, SENSOR)
        # Read after the shape is published: a measurement that is taken as it comes would let the command wait.
        self._tips = Polled(self._node, PoseStamped, "measured/tip", SENSOR)
        self._tensions = Polled(self._node, JointState, "measured/tension", SENSOR)

    def end(self) -> None:
        """Unsubscribe."""
        self._node.destroy_subscription(self._subscription)
        self._tips.destroy()
        self._tensions.destroy()

    def destroy(self) -> None:
        """Destroy publisher and service, and end the estimation."""
        self._end_observer()
        self._node.destroy_publisher(self._publisher)
        self._node.destroy_service(self._service)

    def carried(self, gravity: np.ndarray, stamp: float) -> tuple[Wrench, ...]:
        """Return what the model carries under gravity (3,) at the stamp (s), the unknown load last."""
        found = self._wrenches.wrenches(self._now())
        known = self.payload.wrench(gravity, stamp)
        unknown = None if self._observer is None else self._observer.wrench(gravity, stamp)
        return (*found, *(wrench for wrench in (known, unknown) if wrench is not None))

    def observe(
        self,
        header: Header,
        shape: Shape,
        simulator: Simulator | DynamicSimulator,
        carried: tuple[Wrench, ...],
        wound: np.ndarray | None,
    ) -> None:
        """Compare a shape with what is measured, and publish the estimate."""
        if self._observer is None:
            return
        stamp = seconds(header)
        # Wrenches that are known are part of the model; the observer looks for what is missing.
        follows = self._observer.follow(stamp, shape, wound, self._observer.without(carried))
        if not follows and shape.is_equilibrium and self._has_compliance(simulator):
            self._observer.predict(stamp, shape, self._compliance, self._observer.carries(carried), wound)
        self._measure(self._observer, stamp)
        if self._publisher.get_subscription_count():
            self._publisher.publish(_message(header, self._observer.estimate(shape.gravity, stamp)))

    def _has_compliance(self, simulator: Simulator | DynamicSimulator) -> bool:
        """Renew the tip's compliance occasionally; return False where the shape is not stable."""
        if self._samples % _COMPLIANCE_EVERY == 0:
            try:
                self._compliance = simulator.tip_compliance()
            except NotPositiveDefinite:
                return False
        self._samples += 1
        return True

    def report(self, gravity: np.ndarray, stamp: float) -> tuple[str, dict[str, Any]]:
        """Return what the user has to know, empty while all is well, and the values for /diagnostics."""
        sentences, values = [self._wrenches.sentence], {}
        if self._wrenches.used or self._wrenches.refused:
            values |= {"external_wrenches": self._wrenches.used, "external_wrenches_refused": self._wrenches.refused}
        if self.payload.mass:
            values["payload_g"] = round(1e3 * self.payload.mass, 3)
        if self._observer is not None:
            estimate = self._observer.estimate(gravity, stamp)
            sentences += [f"{topic} is refused: {reason}" for topic, reason in self._refusals.items() if reason]
            sentences.append(estimate.sentence)
            values["load_n"] = ", ".join(f"{value:.4f}" for value in estimate.force)
        return "; ".join(sentence for sentence in sentences if sentence), values

    def _now(self) -> float:
        return self._node.get_clock().now().nanoseconds * 1e-9

    def _on_wrench(self, message: WrenchStamped) -> None:
        used = self._wrenches.take(
            seconds(message.header),
            self._now(),
            message.header.frame_id,
            vector_of(message.wrench.force),
            vector_of(message.wrench.torque),
        )
        if not used:
            self._refuse("external/wrench", self._wrenches.refusal)

    def _measure(self, observer: LoadObserver, now: float) -> None:
        """Pass on what was measured since the last sample, which has the stamp `now` (s)."""
        for received in self._tips.take_all():
            tip = received.message
            if self._accepts("measured/tip", self._objection_to_tip(tip) or _objection_to_stamp(tip.header, now)):
                observer.measure_tip(seconds(tip.header), vector_of(tip.pose.position))
        for received in self._tensions.take_all():
            cells = received.message
            if self._accepts("measured/tension", self._objection_to_cells(cells) or _objection_to_stamp(cells.header, now)):
                tension = dict(zip(cells.name, cells.effort))
                ordered = np.array([tension[name] for name in self._robot.cable_names])
                observer.measure_tensions(seconds(cells.header), ordered)

    def _accepts(self, topic: str, objection: str) -> bool:
        """Remember and log what is wrong with a message; return whether nothing is."""
        if objection:
            self._refuse(topic, objection)
        self._refusals[topic] = objection
        return not objection

    def _objection_to_tip(self, message: PoseStamped) -> str:
        frame = message.header.frame_id
        return "" if frame == self._frames[0] else f"its frame is '{frame}'; '{self._frames[0]}' is needed"

    def _objection_to_cells(self, message: JointState) -> str:
        cables = self._robot.cable_names
        if set(message.name) == set(cables) and len(message.name) == len(message.effort) == len(cables):
            return ""
        return (
            f"it has {len(message.effort)} tensions of {', '.join(message.name) or 'no cable'};"
            f" one of each is needed: {', '.join(cables)}"
        )

    def _refuse(self, topic: str, reason: str) -> None:
        self._node.get_logger().warning(f"{topic} refused: {reason}", throttle_duration_sec=1.0)

    def _on_zero(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if self._observer is None:
            response.message = "no unknown load is looked for: set load.kind to force or payload"
            return response
        self._observer.zero(self._now())
        response.success = True
        response.message = f"learning the errors of model and sensors for {self._observer.options.zero_time:g} s without load"
        return response


def _objection_to_stamp(header: Header, now: float) -> str:
    """Return what is wrong with the stamp of a measurement next to that of gravity, `now` (s); empty for nothing."""
    ahead = seconds(header) - now
    if abs(ahead) <= _FARTHEST:
        return ""
    return (
        f"its stamp is {abs(ahead):.3g} s {'after' if ahead > 0.0 else 'before'} that of gravity; at most {_FARTHEST:g} s are"
        " allowed: the clocks are not synchronised"
    )


def _message(header: Header, estimate: LoadEstimate) -> WrenchEstimate:
    message = WrenchEstimate(header=header, zeroed=estimate.zeroed, sources=list(estimate.sources), message=estimate.sentence)
    force = message.wrench.force
    force.x, force.y, force.z = map(float, estimate.force)
    covariance = np.zeros((6, 6))
    covariance[:3, :3] = estimate.covariance
    message.covariance = doubles(covariance.ravel())
    message.mass, message.mass_std = float(estimate.mass), float(estimate.mass_std)
    return message
