"""External loads of fem_simulator: external/wrench, a payload that changes, and an unknown load that is found.

Known loads come on external/wrench and with the parameter payload_mass_g. An unknown one is estimated from measured/tip and
measured/tension, and published on estimated/wrench.
"""

from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped, WrenchStamped
from rclpy.lifecycle import LifecycleNode
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from std_srvs.srv import Trigger

from gravcomp.description import Robot
from gravcomp.external_loads import LivePayload, WrenchInput
from gravcomp.full_model.robot_model import RobotModel
from gravcomp.full_model.wrench import Wrench
from gravcomp.graph.parameters.fem_simulator import FemSimulatorParameters
from gravcomp.load_estimation import LoadEstimate, LoadObserver, anchored_model
from gravcomp.mechanics.block_matrix import NotPositiveDefinite
from gravcomp.scene.scene import Scene
from gravcomp.simulation import DynamicSimulator, Shape, Simulator
from gravcomp_fem.conversion import doubles, seconds, vector_of
from gravcomp_msgs.msg import WrenchEstimate
from gravcomp_node import SENSOR

_COMPLIANCE_EVERY = 10  # samples between two computations of the tip's compliance
_ANCHORED_SHARE = 0.3  # of the time: the rest is for the shape that the command needs


class LoadInputs:
    """The loads of `node`'s robot."""

    def __init__(
        self,
        node: LifecycleNode,
        robot: Robot,
        parameters: FemSimulatorParameters,
        model: RobotModel,
        scene: Scene | None,
    ):
        """model: of the robot, as the simulator has it; scene: what it touches."""
        self._node, self._robot, self._model, self._scene = node, robot, model, scene
        self._frames = parameters.base_frame, parameters.tip_frame
        self.payload = LivePayload(robot, parameters.external.ramp_time)
        self._publisher = node.create_publisher(WrenchEstimate, "estimated/wrench", SENSOR)
        self._service = node.create_service(Trigger, "~/zero_load", self._on_zero)
        self._begin_wrenches(parameters)
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
        self._observer, kind = None, parameters.load.kind
        if kind != "none":
            anchored = anchored_model(self._model, kind, self._scene)
            self._observer = LoadObserver(self._robot, parameters.load, anchored, _ANCHORED_SHARE)
        self._samples, self._compliance = 0, np.zeros((3, 3))

    def begin(self) -> None:
        """Subscribe, without any load."""
        self._wrenches.reset()
        if self._observer is not None:
            self._observer.reset()
        self._samples = 0
        create = self._node.create_subscription
        self._subscriptions = [
            create(WrenchStamped, "external/wrench", self._on_wrench, SENSOR),
            create(PoseStamped, "measured/tip", self._on_tip, SENSOR),
            create(JointState, "measured/tension", self._on_tension, SENSOR),
        ]

    def end(self) -> None:
        """Unsubscribe."""
        for subscription in self._subscriptions:
            self._node.destroy_subscription(subscription)

    def destroy(self) -> None:
        """Destroy publisher and service."""
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
        if not self._observer.follow(stamp, shape, wound, self._observer.without(carried)):
            if not shape.is_equilibrium or not self._has_compliance(simulator):
                return
            self._observer.predict(stamp, shape, self._compliance, self._observer.carries(carried), wound)
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

    def _on_tip(self, message: PoseStamped) -> None:
        if self._observer is None:
            return
        if message.header.frame_id != self._frames[0]:
            self._refuse("measured/tip", f"its frame is '{message.header.frame_id}'; '{self._frames[0]}' is needed")
            return
        self._observer.measure_tip(seconds(message.header), vector_of(message.pose.position))

    def _on_tension(self, message: JointState) -> None:
        if self._observer is None:
            return
        tension, cables = dict(zip(message.name, message.effort)), self._robot.cable_names
        if set(tension) != set(cables) or len(message.effort) != len(cables):
            self._refuse("measured/tension", f"it names {', '.join(message.name) or 'nothing'}; needed: {', '.join(cables)}")
            return
        self._observer.measure_tensions(seconds(message.header), np.array([tension[name] for name in cables]))

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


def _message(header: Header, estimate: LoadEstimate) -> WrenchEstimate:
    message = WrenchEstimate(header=header, zeroed=estimate.zeroed, sources=list(estimate.sources), message=estimate.sentence)
    force = message.wrench.force
    force.x, force.y, force.z = map(float, estimate.force)
    covariance = np.zeros((6, 6))
    covariance[:3, :3] = estimate.covariance
    message.covariance = doubles(covariance.ravel())
    message.mass, message.mass_std = float(estimate.mass), float(estimate.mass_std)
    return message
