"""Node fem_simulator: computes the robot's shape under the virtual gravity, one equilibrium per sample of gravity.

The model is fixed in `soft_base` while its gravity turns. Its cable displacements are the commanded ones, limited to the speed
of the winches, or the measured ones. Before the first message about the cables they are released. In the mode `dynamic` the
model moves from one stamp to the next, starting at rest in the first equilibrium. While the base turns, the forces of its turn
are added to gravity (`gravcomp.external_loads.base_turn`), from the rate in imu/data, if anybody publishes it.
"""

import contextlib
import os
import subprocess
import sys
from collections.abc import Sequence

import numpy as np
from geometry_msgs.msg import PoseStamped, Vector3Stamped
from gravcomp_node.local_topics import Adapted
from gravcomp_node.managed_node import ERROR, OK, WARN
from gravcomp_node.polled import Polled
from rclpy.timer import Timer
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Header
from visualization_msgs.msg import MarkerArray

from gravcomp.arm.shape_chain import joint_names, joint_positions
from gravcomp.config import ConfigError
from gravcomp.external_loads import LivePayload, holdable_payload
from gravcomp.external_loads.base_turn import BaseTurn
from gravcomp.full_model.wrench import Wrench
from gravcomp.graph.parameters.fem_simulator import FemSimulatorParameters
from gravcomp.inverse.limits import within_limits
from gravcomp.launcher import model_builder
from gravcomp.mechanics.block_matrix import NotPositiveDefinite
from gravcomp.mesh.mesh import MeshError
from gravcomp.simulation import DynamicSimulator, Shape, ShapeStatus, Simulator
from gravcomp.simulation.late_reduction import LateReduction
from gravcomp.standard_gravity import LARGEST_GRAVITY
from gravcomp_fem.conversion import pose_message, seconds, vector_of
from gravcomp_fem.deformed import PublishedShape
from gravcomp_fem.load_inputs import LoadInputs
from gravcomp_fem.markers import RobotMarkers
from gravcomp_fem.transforms import TransformPublisher
from gravcomp_msgs.msg import CableCommand, CableState, Deformation
from gravcomp_node import COMMAND, SENSOR, ManagedNode, run

# Motion over a longer gap between two stamps is not computed, because it would delay the following samples.
_LONGEST_GAP = 0.1  # s
# Commands respect the cables' speed limit; the model follows a command at up to this multiple of it.
_SPEED_MARGIN = 2.0
_BUILDER_DELAY = 10.0  # s; a node that runs for a shorter time builds no reduced model


class FemSimulator(ManagedNode):
    """Publishes the robot's deformation under the virtual gravity."""

    name = "fem_simulator"
    parameters_class = FemSimulatorParameters
    _holdable = 0.0  # kg, payload at the tip; 0: not known before the model is there

    def configure(self) -> None:
        """Create the simulator and compile its functions."""
        self._dynamic = self.parameters.mode == "dynamic"
        scene = self.robot_file.scene
        if self._dynamic and scene:
            raise ConfigError(f"{self.robot_file.source}: scene needs the mode static of fem_simulator; mode is dynamic")
        robot = self.robot_file.robot.with_assumed_lines()
        self._simulator = DynamicSimulator(robot) if self._dynamic else Simulator(robot, scene=scene)
        self._cables: np.ndarray | None = None  # m, of the model
        self._wanted: np.ndarray | None = None  # m, commanded or measured
        # Functions that are not cached yet are compiled here rather than when the first sample, or the first pull, arrives.
        self._simulator.warm_up()
        cables = np.zeros(len(self.robot_file.robot.cables))
        straight = self._simulator.step(np.zeros(3), cables)
        within_limits(cables, cables, robot.limits, 0.0)
        with contextlib.suppress(NotPositiveDefinite, MeshError):  # unstable, or without a section at its end
            self._holdable = holdable_payload(straight, self._simulator.tip_compliance(), robot.limits.tension_max)
        # Walls and zones in the world turn with the gravity of the model: it has to be the true one.
        around = scene.walls or self.robot_file.zones or not self.parameters.turn.enabled
        self._turn = None if around else BaseTurn(self._simulator.model, self.parameters.turn)
        self._late_reduction = LateReduction(self._simulator)
        self._builder: subprocess.Popen | None = None
        self._builder_timer: Timer | None = None
        if self._late_reduction.missing and model_builder.MARK not in os.environ:
            self._builder_timer = self.create_timer(_BUILDER_DELAY, self._start_builder)
        self._deformation = self.create_publisher(Deformation, "robot/deformation", SENSOR)
        self._tip = self.create_publisher(PoseStamped, "robot/tip", SENSOR)
        self._markers = self.create_publisher(MarkerArray, "robot/markers", COMMAND)
        self._robot_markers = RobotMarkers(self.robot_file.robot)
        self._transforms = TransformPublisher(self)
        points = len(self.robot_file.robot.effectors.backbone_station)
        self._chain_names = joint_names(self.parameters.joint_prefix, points)
        self._chain = self.create_publisher(JointState, "joint_states", 10) if self.parameters.shape_joints else None
        self._loads = LoadInputs(self, self.robot_file.robot, self.parameters, self._simulator.model, scene, self._holdable)

    def activate(self) -> None:
        """Reset the simulator and subscribe."""
        self._simulator.reset()
        self._refused = 0
        self._last_stamp: float | None = None
        self._last_markers = -np.inf
        self._loads.begin()
        self._gravity_subscription = self.create_subscription(Vector3Stamped, "gravity", self._on_gravity, SENSOR)
        # Read when gravity arrives, because the cables are needed then; a second wake-up per sample costs 10 % of a core.
        if self.parameters.cables_from == "command":
            self._cable_topic = Polled(self, CableCommand, "cable/command", COMMAND)
        else:
            self._cable_topic = Polled(self, CableState, "cable/state", SENSOR)
        if self._turn is not None:
            self._turn.reset()
            self._imu_topic = Polled(self, Imu, "imu/data", SENSOR)
        self.report(WARN, "waiting for gravity")

    def deactivate(self) -> None:
        """Unsubscribe."""
        self.destroy_subscription(self._gravity_subscription)
        self._cable_topic.destroy()
        if self._turn is not None:
            self._imu_topic.destroy()
        self._loads.end()

    def cleanup(self) -> None:
        """Destroy the publishers and end the build of the reduced model."""
        self._late_reduction.stop()
        self._cancel_builder_timer()
        if self._builder is not None:
            self._builder.terminate()
            self._builder.wait()
        for publisher in (self._deformation, self._tip, self._markers, self._chain):
            if publisher is not None:
                self.destroy_publisher(publisher)
        self._transforms.destroy()
        self._loads.destroy()

    def check_parameters(self, new: FemSimulatorParameters) -> None:
        """Refuse a payload that the robot cannot carry."""
        if new.payload_mass >= 0.0:
            LivePayload(self.robot_file.robot, 0.0, self._holdable).check(new.payload_mass)

    def parameters_changed(self, old: FemSimulatorParameters, new: FemSimulatorParameters) -> None:
        """Apply a new payload and new options of the loads."""
        if hasattr(self, "_loads"):
            self._loads.change(old, new)
            if self._turn is not None:
                self._turn.options = new.turn

    def _start_builder(self) -> None:
        """Build the reduced model in a process of low priority, when no launcher does."""
        self._cancel_builder_timer()
        if self._late_reduction.missing:
            self._builder = model_builder.start_builder(self.robot_file.source)

    def _cancel_builder_timer(self) -> None:
        if self._builder_timer is not None:
            self.destroy_timer(self._builder_timer)
            self._builder_timer = None

    def _read_cables(self) -> None:
        """Read the displacements since the last sample; the newest valid ones are used."""
        for received in self._cable_topic.take_all():
            message = received.message
            if isinstance(message, CableCommand):
                self._take_cables(message.displacement, "cable/command")
            elif message.state != CableState.UNCONFIGURED:
                self._take_cables(message.displacement, "cable/state")

    def _take_cables(self, field: Sequence[float], topic: str) -> None:
        displacement = np.array(field, dtype=float)
        expected = (len(self.robot_file.robot.cables),)
        if displacement.shape != expected or not np.isfinite(displacement).all():
            self._refuse(f"{topic} has {displacement.tolist()}; {expected[0]} finite displacements are needed")
            return
        length = self.robot_file.robot.length
        if (np.abs(displacement) > length).any():
            self._refuse(f"{topic} has {displacement.tolist()} m; at most the robot's length of {length:g} m is allowed")
            return
        self._wanted = displacement

    def _turned(self, stamp: float) -> np.ndarray:
        """Return what the base's turn adds to gravity (3,) at `stamp` s."""
        if self._turn is None:
            return np.zeros(3)
        for received in self._imu_topic.take_all():
            in_base = self.robot_file.robot.imu_mount.rotation @ vector_of(received.message.angular_velocity)
            self._turn.add(seconds(received.message.header), in_base)
        return self._turn.acceleration(stamp)

    def _move_cables(self, interval: float) -> None:
        """Move the model's cables toward the wanted displacements, for `interval` (s)."""
        if self._cables is None or self.parameters.cables_from != "command":
            self._cables = self._wanted
        else:
            self._cables = within_limits(self._wanted, self._cables, self.robot_file.robot.limits, _SPEED_MARGIN * interval)

    def _on_gravity(self, message: Vector3Stamped) -> None:
        self._read_cables()
        gravity = vector_of(message.vector)
        if not np.isfinite(gravity).all() or np.linalg.norm(gravity) > LARGEST_GRAVITY:
            self._refuse(f"gravity is {gravity.tolist()}; finite numbers up to {LARGEST_GRAVITY:g} m/s^2 are needed")
            return
        stamp = seconds(message.header)
        last, self._last_stamp = self._last_stamp, stamp
        elapsed = None if last is None or stamp <= last else stamp - last
        interval = None if elapsed is None or elapsed > _LONGEST_GAP else elapsed
        turn = self._turned(stamp)
        load = gravity + turn
        self._move_cables(interval or _LONGEST_GAP)
        self._late_reduction.exchange()
        carried = self._loads.carried(load, stamp)
        shape = self._shape(load, interval if self._dynamic else elapsed, carried)
        if not np.isfinite(shape.tip_position).all():
            self._simulator.reset()  # otherwise the next step would start at an invalid shape
            self._refuse(
                f"gravity {load.tolist()} m/s^2 and the cable displacements give no finite shape; the simulator restarts"
            )
            return
        header = Header(stamp=message.header.stamp, frame_id=self.parameters.base_frame)
        self._deformation.publish(Adapted(PublishedShape(shape, header, turn), PublishedShape.message))
        self._loads.observe(header, shape, self._simulator, carried, self._cables)
        if self._tip.get_subscription_count():
            tip = pose_message(shape.tip_position, shape.tip_orientation)
            self._tip.publish(PoseStamped(header=header, pose=tip))
        self._show(shape, header, gravity)
        level = {ShapeStatus.OK: OK, ShapeStatus.FALLBACK: WARN}.get(shape.status, ERROR)
        of_loads, values = self._loads.report(load, stamp)
        self.report(
            max(level, WARN) if of_loads else level,
            "; ".join(part for part in (shape.message or "following gravity", of_loads) if part),
            model=shape.model,
            solve_time_ms=round(1e3 * shape.solve_time, 3),
            residual_n=f"{shape.residual:.2e}",
            refused_messages=self._refused,
            **values,
        )
        if isinstance(self._simulator, Simulator):
            self._simulator.measure_error()  # the command to this sample is on its way; the next one comes some ms later

    def _shape(self, gravity: np.ndarray, interval: float | None, carried: tuple[Wrench, ...]) -> Shape:
        """Return the shape; interval: s since the last sample, or None when it is not known; carried: external loads."""
        if not self._dynamic:  # a body that creeps is relaxed in its first equilibrium
            return self._simulator.step(gravity, self._cables, duration=interval, wrench=carried, later=True)
        if interval is None:
            return self._simulator.settle(gravity, self._cables)
        return self._simulator.step(gravity, self._cables, duration=interval, wrench=carried)

    def _show(self, shape: Shape, header: Header, gravity: np.ndarray) -> None:
        rate = self.parameters.marker_rate
        stamp = seconds(header)
        # A stamp that goes back means that a replay has restarted.
        if rate == 0.0 or 0.0 <= stamp - self._last_markers < 1.0 / rate:
            return
        self._last_markers = stamp
        if self._markers.get_subscription_count():
            self._markers.publish(self._robot_markers.of(shape, header, gravity))
        self._transforms.publish(shape, header, self.parameters.tip_frame)
        if self._chain is not None:
            positions = joint_positions(shape.backbone_position, self.robot_file.robot.length)
            self._chain.publish(JointState(header=header, name=self._chain_names, position=positions))

    def _refuse(self, sentence: str) -> None:
        self._refused += 1
        self.get_logger().warning(sentence, throttle_duration_sec=1.0)


def main() -> int:
    """Run the node; return the exit code."""
    return run(FemSimulator)


if __name__ == "__main__":
    sys.exit(main())
