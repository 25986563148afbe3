"""Node calibrator: leads through a planned calibration, and writes the tips that a tracker measures.

It stops the controller, pulls the cables as planned with the stamp of the gravity that caused it, and exits after the last pose.
What to do, when it is done, and the file are those of `gravcomp.calibration.live`.
"""

import json
from pathlib import Path

import numpy as np
from geometry_msgs.msg import PoseStamped, Vector3Stamped
from gravcomp_node.managed_node import OK, WARN
from std_srvs.srv import SetBool

from gravcomp.calibration.bag import direction_of_poses
from gravcomp.calibration.live import LiveSession, Phase
from gravcomp.calibration.measured import MeasurementError
from gravcomp.calibration.plan_file import load_plan
from gravcomp.config import ConfigError
from gravcomp.graph.parameters.calibrator import CalibratorParameters
from gravcomp_fem.conversion import seconds
from gravcomp_msgs.msg import CableCommand, CableState
from gravcomp_node import COMMAND, SENSOR, ManagedNode, run

_PERIOD = 0.1  # s, between two looks at the state


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
            self._session = LiveSession(self.robot_file.robot, load_plan(Path(p.plan)), Path(p.out))
        except MeasurementError as error:
            raise ConfigError(str(error)) from error
        self._command = self.create_publisher(CableCommand, "cable/command", COMMAND)

    def activate(self) -> None:
        """Stop the controller, and subscribe."""
        self._present: np.ndarray | None = None
        self._shown, self._stopped = "", False
        self._controller = self.create_client(SetBool, "inverse_controller/enable")
        self._inputs = [
            self.create_subscription(Vector3Stamped, "gravity", self._on_gravity, SENSOR),
            self.create_subscription(CableState, "cable/state", self._on_state, SENSOR),
            self.create_subscription(PoseStamped, self.parameters.tip_topic, self._on_tip, SENSOR),
        ]
        self._watch = self.create_timer(_PERIOD, self._show)

    def deactivate(self) -> None:
        """Unsubscribe; the motors hold."""
        self.destroy_timer(self._watch)
        for subscription in self._inputs:
            self.destroy_subscription(subscription)

    def cleanup(self) -> None:
        """Destroy the publisher."""
        self.destroy_publisher(self._command)

    def _on_state(self, message: CableState) -> None:
        self._present = np.array(message.displacement)

    def _on_gravity(self, message: Vector3Stamped) -> None:
        time = seconds(message.header)
        vector = message.vector
        self._session.on_gravity(time, np.array([vector.x, vector.y, vector.z]))
        if self._present is None or not self._stopped:
            return
        displacement = self._session.command(time, self._present)
        if displacement is not None:
            pose = self._session.pose
            command = CableCommand(displacement=displacement.tolist())
            command.tension = [] if pose is None or self._session.phase == Phase.TURN else pose.tension.tolist()
            command.header.stamp = message.header.stamp
            self._command.publish(command)

    def _on_tip(self, message: PoseStamped) -> None:
        time = seconds(message.header)
        place, turn = message.pose.position, message.pose.orientation
        values = np.array([[place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w]])
        if np.isfinite(values).all() and np.linalg.norm(values[0, 3:]) > 0.0:
            self._session.on_tip(time, values[0, :3], direction_of_poses(values)[0])

    def _show(self) -> None:
        """Stop the controller once it is there, and write what to do."""
        if not self._stopped and self._controller.service_is_ready():
            self._controller.call_async(SetBool.Request(data=False))
            self._stopped = True
        sentence = self._session.sentence() if self._stopped else "waiting for the controller, which is to stop"
        if self._stopped and self._present is None:
            sentence = "waiting for cable/state: is the robot running?"
        if sentence != self._shown:
            self._shown = sentence
            self._write(sentence)
        self.report(OK if self._stopped else WARN, sentence, finished=self._session.finished)
        self.finished = self._session.phase == Phase.DONE

    def _write(self, sentence: str) -> None:
        if not self.parameters.state_file:
            return
        state = {"do": sentence, "finished": self._session.finished, "done": self._session.phase == Phase.DONE}
        partial = Path(self.parameters.state_file + ".partial")
        partial.write_text(json.dumps(state), encoding="utf-8")
        partial.replace(self.parameters.state_file)


def main() -> int:
    """Run the node; return the exit code."""
    return run(Calibrator)
