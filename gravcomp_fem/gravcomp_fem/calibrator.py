"""Node calibrator: leads through a planned calibration, and writes the tips that a tracker measures.

It pulls the cables as planned once the controller says that it has stopped, with the stamp of the gravity that caused it, and
exits when the last pose is in the file.
What to do, when it is done, and the file are those of `gravcomp.calibration.live`.
"""

import contextlib
import json
from pathlib import Path

import numpy as np
from geometry_msgs.msg import PoseStamped, Vector3Stamped
from gravcomp_node.managed_node import OK, WARN
from gravcomp_node.repeated_call import RepeatedCall
from sensor_msgs.msg import Imu
from std_srvs.srv import SetBool

from gravcomp.calibration.approach import as_pulled
from gravcomp.calibration.bag import direction_of_poses
from gravcomp.calibration.live import LiveSession, Phase
from gravcomp.calibration.measured import MeasurementError
from gravcomp.calibration.plan_file import load_plan
from gravcomp.config import ConfigError
from gravcomp.graph.parameters.calibrator import CalibratorParameters
from gravcomp.whole_file import write_whole
from gravcomp_fem.conversion import seconds, vector_of
from gravcomp_msgs.msg import CableCommand, CableState
from gravcomp_node import COMMAND, SENSOR, ManagedNode, run

_PERIOD = 0.1  # s, between two looks at the state
_RETRY = 1.0  # s, between two attempts to write


class Calibrator(ManagedNode):
    """Leads through a calibration."""

    name = "calibrator"
    parameters_class = CalibratorParameters

    def configure(self) -> None:
        """Read the plan, and begin or continue the file. Raises ConfigError."""
        p = self.parameters
        if not p.plan or not p.out:
            raise ConfigError("calibrator: plan and out are needed; ./gravcomp calibrate --live gives both")
        try:
            self._session = LiveSession(
                as_pulled(self.robot_file.robot, self.robot_file.hardware), load_plan(Path(p.plan)), Path(p.out)
            )
        except MeasurementError as error:
            raise ConfigError(str(error)) from error
        self._command = self.create_publisher(CableCommand, "cable/command", COMMAND)

    def activate(self) -> None:
        """Stop the controller, and subscribe."""
        self._present: np.ndarray | None = None
        self._shown, self._written_at = "", 0.0
        self._stop = RepeatedCall(self.create_client(SetBool, "inverse_controller/enable"), SetBool.Request(data=False))
        self._stopped = False
        self._inputs = [
            self.create_subscription(Vector3Stamped, "gravity", self._on_gravity, SENSOR),
            self.create_subscription(CableState, "cable/state", self._on_state, SENSOR),
            self.create_subscription(PoseStamped, self.parameters.tip_topic, self._on_tip, SENSOR),
            self.create_subscription(Imu, "imu/data", self._on_imu, SENSOR),
        ]
        self._watch = self.create_timer(_PERIOD, self._show)

    def deactivate(self) -> None:
        """Unsubscribe, and write what is not in the file yet; the motors hold."""
        self.destroy_timer(self._watch)
        for subscription in self._inputs:
            self.destroy_subscription(subscription)
        if not self._session.save():
            self.get_logger().error(f"the last measured poses are lost: {self._session.unwritten}")

    def cleanup(self) -> None:
        """Destroy the publisher."""
        self.destroy_publisher(self._command)

    def _on_state(self, message: CableState) -> None:
        self._present = np.array(message.displacement)

    def _on_gravity(self, message: Vector3Stamped) -> None:
        time = seconds(message.header)
        self._session.on_gravity(time, vector_of(message.vector))
        if self._present is None or not self._stopped:
            return
        displacement = self._session.command(time, self._present)
        if displacement is not None:
            pose = self._session.pose
            command = CableCommand(displacement=displacement.tolist())
            command.tension = [] if pose is None or self._session.phase == Phase.TURN else pose.tension.tolist()
            command.header.stamp = message.header.stamp
            self._command.publish(command)

    def _on_imu(self, message: Imu) -> None:
        if message.linear_acceleration_covariance[0] >= 0.0:  # -1: it measures none (sensor_msgs/Imu)
            self._session.on_force(seconds(message.header), vector_of(message.linear_acceleration))

    def _on_tip(self, message: PoseStamped) -> None:
        time = seconds(message.header)
        place, turn = message.pose.position, message.pose.orientation
        values = np.array([[place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w]])
        # One and the same direction, where a tracker measures positions alone and leaves the orientation empty.
        direction = direction_of_poses(values)[0] if np.linalg.norm(values[0, 3:]) > 0.0 else np.array([0.0, 0.0, 1.0])
        self._session.on_tip(time, values[0, :3], direction)

    def _show(self) -> None:
        """Stop the controller once it is there, write what to do, and end after the last pose."""
        self._stopped = self._stop.succeeds()
        sentence = self._session.sentence()
        if not self._stopped:
            refusal = self._stop.refusal
            sentence = f"the controller does not stop: {refusal}" if refusal else "waiting for the controller, which is to stop"
        elif self._present is None:
            sentence = "waiting for cable/state: is the robot running?"
        now = self._now()
        saved = not self._session.unwritten
        if not saved and now - self._written_at >= _RETRY:
            self._written_at, saved = now, self._session.save()
        if sentence != self._shown:
            self._shown = sentence
            self._write(sentence)
            if self._session.unwritten:  # the file of the state may be on the same full disk
                self.get_logger().warning(sentence)
        self.report(OK if self._stopped and saved else WARN, sentence, finished=self._session.finished)
        self.finished = self._session.phase == Phase.DONE and saved

    def _now(self) -> float:
        return self.get_clock().now().nanoseconds * 1e-9

    def _write(self, sentence: str) -> None:
        if not self.parameters.state_file:
            return
        state = {"do": sentence, "finished": self._session.finished, "done": self._session.phase == Phase.DONE}
        with contextlib.suppress(OSError):  # a full disk must not end the measurement
            write_whole(Path(self.parameters.state_file), json.dumps(state))


def main() -> int:
    """Run the node; return the exit code."""
    return run(Calibrator)
