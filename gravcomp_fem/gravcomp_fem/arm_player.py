"""Node arm_player: simulates an arm that carries the virtual robot through five poses, first released, then compensated.

It publishes joint_states and robot_description like an arm, rotates the virtual robot's base with the arm's flange, and
measures the tip error with the virtual robot's ground truth. The loop receives nothing else from it. A pass begins when the
controller has accepted the request and the bridge follows commands. The figures include the share of samples during which the
bridge followed, because holding motors do not compensate.
"""

import json
import sys
from pathlib import Path

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, QuaternionStamped
from gravcomp_node.managed_node import OK
from gravcomp_node.polled import Polled
from gravcomp_node.repeated_call import RepeatedCall
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger

from gravcomp.arm.chain import Chain
from gravcomp.arm.description import read_urdf
from gravcomp.arm.tour import FIVE_POSES, Tour
from gravcomp.config import ConfigError
from gravcomp.graph.parameters.arm_player import ArmPlayerParameters
from gravcomp.mesh.robot_axis import rest_tip
from gravcomp.virtual.motion import quaternion
from gravcomp.whole_file import write_whole
from gravcomp_fem.conversion import vector_of
from gravcomp_msgs.msg import CableState
from gravcomp_node import COMMAND, LATCHED, SENSOR, ManagedNode, run

_RATE = 50.0  # Hz, of joint_states
_LONGEST_MOTION = 2.5 / _RATE  # s, by which the tour goes on between two messages
_PASSES = ("released", "compensated")


class ArmPlayer(ManagedNode):
    """Moves an arm through the poses and measures the tip error at each."""

    name = "arm_player"
    parameters_class = ArmPlayerParameters

    def configure(self) -> None:
        """Read the URDF. Raises ConfigError when it cannot be read or has another number of joints."""
        text = read_urdf(self.parameters.urdf)
        self._chain = Chain(text, self.parameters.base_frame, self.parameters.world_frame, self.parameters.urdf)
        poses = np.array(list(FIVE_POSES.values()))
        if len(self._chain.moving) != poses.shape[1]:
            raise ConfigError(
                f"{self.parameters.urdf}: {len(self._chain.moving)} joints move '{self._chain.tip}'; {poses.shape[1]} are needed"
            )
        self._tour = Tour(poses, self.parameters.travel, self.parameters.hold)
        self._joints = self.create_publisher(JointState, "joint_states", QoSProfile(depth=10))
        self._base = self.create_publisher(QuaternionStamped, "virtual/base_orientation", COMMAND)
        self._description = self.create_publisher(String, "robot_description", LATCHED)
        self._description.publish(String(data=text))
        self._relax = self.create_client(Trigger, "inverse_controller/relax")
        self._enable = self.create_client(SetBool, "inverse_controller/enable")

    def activate(self) -> None:
        """Subscribe and start moving."""
        self._ready: float | None = None  # s, since when robot and services are available
        self._moved: float | None = None  # s, the last motion of the pass; None: it has not begun
        self._time = 0.0  # s, since the start of the pass
        self._pass = 0
        self._measuring = False
        self._begins = (RepeatedCall(self._relax, Trigger.Request()), RepeatedCall(self._enable, SetBool.Request(data=True)))
        self._phase = ""
        self._tip: np.ndarray | None = None
        self._bridge: CableState | None = None
        self._errors = {name: [[] for _ in FIVE_POSES] for name in _PASSES}
        self._followed: dict[str, list[bool]] = {name: [] for name in _PASSES}
        self._disagreement: list[float] = []
        self._truth = Polled(self, PoseStamped, "truth/tip", SENSOR)
        self._bridge_states = Polled(self, CableState, "cable/state", COMMAND)
        self._reports = self.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, QoSProfile(depth=50))
        self._ticks = self.create_timer(1.0 / _RATE, self._tick)

    def deactivate(self) -> None:
        """Stop moving."""
        self.destroy_timer(self._ticks)
        self.destroy_subscription(self._reports)
        for polled in (self._truth, self._bridge_states):
            polled.destroy()

    def _tick(self) -> None:
        self._read_polled()
        now = self.get_clock().now().nanoseconds * 1e-9
        # A process that the machine has halted moves the arm on from where it is: an arm does not jump.
        time = 0.0 if self._moved is None else self._time + min(max(now - self._moved, 0.0), _LONGEST_MOTION)
        self._time = time
        if time >= self._tour.duration:
            self._pass, self._moved, self._measuring, time = self._pass + 1, None, False, 0.0
            if self._pass == len(_PASSES):
                self._write("done", self._figures())
                self.finished = True
                return
        self._move(self._tour.positions(time))
        if self._moved is None:
            self._prepare(now)
            return
        self._moved = now
        pose = self._tour.at_rest(time, self.parameters.hold - self.parameters.measured)
        self._measuring = pose is not None
        if pose is not None:
            target, _ = rest_tip(self.robot_file.robot)
            name = _PASSES[self._pass]
            self._errors[name][pose].append(float(np.linalg.norm(self._tip - target)))
            self._followed[name].append(self._bridge.state == CableState.ACTIVE)

    def _prepare(self, now: float) -> None:
        """Start the pass when everything is available, has rested, and the controller has accepted the request."""
        available = (
            self._tip is not None
            and self._bridge is not None
            and self._relax.service_is_ready()
            and self._enable.service_is_ready()
        )
        if not available:
            self._set_phase("waiting for the ground truth")
            return
        # Rest before the first motion: the estimator needs it for gravity and the gyroscope's bias.
        self._ready = now if self._ready is None else self._ready
        if now - self._ready < self.parameters.wait:
            self._set_phase("at rest")
        elif not self._begins[self._pass].succeeds():
            refusal = self._begins[self._pass].refusal
            self._set_phase(f"waiting for the controller: {refusal}" if refusal else "waiting for the controller")
        elif self._bridge.state != CableState.ACTIVE:
            self._set_phase(f"waiting for the bridge: {self._bridge.message}")
        else:
            self._moved = now
            self._set_phase(_PASSES[self._pass])

    def _move(self, positions: np.ndarray) -> None:
        joints = JointState(name=list(self._chain.moving), position=positions.tolist())
        joints.header.stamp = self.get_clock().now().to_msg()
        self._joints.publish(joints)
        base = QuaternionStamped()
        base.header.stamp, base.header.frame_id = joints.header.stamp, self.parameters.world_frame
        rotation = self._chain.pose(dict(zip(joints.name, positions)))[:3, :3]
        q = base.quaternion
        q.x, q.y, q.z, q.w = map(float, quaternion(rotation))
        self._base.publish(base)

    def _read_polled(self) -> None:
        """Read the newest messages of tip and bridge."""
        if truth := self._truth.take():
            self._tip = vector_of(truth.message.pose.position)
        if state := self._bridge_states.take():
            self._bridge = state.message

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name == f"{self.get_namespace().rstrip('/')}/arm_gravity" and self._measuring:
                self._disagreement += [float(pair.value) for pair in status.values if pair.key == "angle_deg"]

    def _figures(self) -> dict:
        means = {name: [1e3 * float(np.mean(e)) if e else float("nan") for e in errors] for name, errors in self._errors.items()}
        rms = {name: float(np.sqrt(np.mean(np.square(values)))) for name, values in means.items()}
        return {
            "inclination_deg": list(FIVE_POSES),
            **{f"tip_error_{name}_mm": [round(v, 3) for v in values] for name, values in means.items()},
            **{f"tip_error_{name}_rms_mm": round(value, 3) for name, value in rms.items()},
            "ratio": round(rms["released"] / rms["compensated"], 2),
            "followed_percent": {name: round(100.0 * float(np.mean(f)), 1) if f else 0.0 for name, f in self._followed.items()},
            "arm_and_imu_disagree_by_deg": round(max(self._disagreement), 2) if self._disagreement else None,
        }

    def _set_phase(self, phase: str) -> None:
        if phase != self._phase:
            self._phase = phase
            self.report(OK, phase)
            self._write(phase, {})

    def _write(self, phase: str, figures: dict) -> None:
        if not self.parameters.result_file:
            return
        write_whole(Path(self.parameters.result_file), json.dumps({"phase": phase, "figures": figures}))


def main() -> int:
    """Run the node; return the exit code."""
    return run(ArmPlayer)


if __name__ == "__main__":
    sys.exit(main())
