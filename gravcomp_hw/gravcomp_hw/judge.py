"""Node judge: runs release and compensation on a running graph, and evaluates them with the virtual robot's ground truth.

It controls the run only through the controller's services, publishes nothing to the loop, and exits after writing the figures to
its result file.
"""

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped, Vector3Stamped
from gravcomp_node.polled import Polled
from gravcomp_node.repeated_call import RepeatedCall
from lifecycle_msgs.srv import GetState
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.task import Future
from rclpy.time import Time
from sensor_msgs.msg import Imu
from std_srvs.srv import SetBool, Trigger

from gravcomp.config import ConfigError
from gravcomp.description.hardware import CanInterface
from gravcomp.evaluation import run_figures as figures
from gravcomp.evaluation.bus_delay import DelayListener
from gravcomp.evaluation.released import released_tip_error
from gravcomp.evaluation.track import Track
from gravcomp.firmware import requests
from gravcomp.firmware.client import BoardClient
from gravcomp.graph.parameters.judge import JudgeParameters
from gravcomp.inverse import Holdable
from gravcomp.mesh.robot_axis import rest_tip
from gravcomp.whole_file import write_whole
from gravcomp_msgs.msg import CableCommand, CableState, ControllerStatus, Deformation
from gravcomp_node import LATCHED, SENSOR, ManagedNode, run

# Messages that the middleware keeps between two reads, which are 0.1 s apart.
_KEPT = 100


class Judge(ManagedNode):
    """Runs the demo's scenario and evaluates it with the ground truth."""

    name = "judge"
    parameters_class = JudgeParameters

    def configure(self) -> None:
        """Prepare the tracks and, if the delay is measured, the CAN listener."""
        self._truth_tip, self._model_tip = Track(3), Track(3)
        self._truth_gravity, self._gravity = Track(3), Track(3)
        self._imu, self._commands, self._by_full_model = Track(0), Track(0), Track(1)
        self._states: dict[str, str] = {}
        self._phase, self._begin, self._compensated_at = "waiting for the ground truth", None, None
        self._released = False  # the controller has answered that it pays the cables out
        self._target, self._direction = rest_tip(self.robot_file.robot)
        self._delay = DelayListener(self._can()) if self.parameters.measure_delay else None

    def activate(self) -> None:
        """Create subscriptions, clients and timers."""
        self._waiting_since = self._now()
        kept = QoSProfile(reliability=ReliabilityPolicy.BEST_EFFORT, depth=_KEPT)
        self._sources = [
            (Polled(self, kind, topic, kept), track, values)
            for kind, topic, track, values in (
                (PoseStamped, "truth/tip", self._truth_tip, _position),
                (PoseStamped, "robot/tip", self._model_tip, _position),
                (Vector3Stamped, "truth/gravity", self._truth_gravity, _vector),
                (Vector3Stamped, "gravity", self._gravity, _vector),
                (Imu, "imu/data_raw", self._imu, lambda message: ()),
                (CableCommand, "cable/command", self._commands, lambda message: ()),
            )
        ]
        self._status = Polled(self, ControllerStatus, "controller/status", LATCHED)
        self._deformation = Polled(self, Deformation, "robot/deformation", SENSOR)
        self._cables = Polled(self, CableState, "cable/state", SENSOR)
        self._fault: str | None = None  # why the bridge drives no motor
        self._unholdable: str | None = None
        self._relax = RepeatedCall(self.create_client(Trigger, "inverse_controller/relax"), Trigger.Request())
        self._enable = RepeatedCall(self.create_client(SetBool, "inverse_controller/enable"), SetBool.Request(data=True))
        self._stop = None
        if self.parameters.standalone:
            self._stop = RepeatedCall(self.create_client(Trigger, "can_bridge/stop"), Trigger.Request())
        self._state_clients = {name: self.create_client(GetState, f"{name}/get_state") for name in self.parameters.nodes}
        self.create_timer(0.1, self._run_scenario)
        self.create_timer(0.5, self._observe)
        if self._delay:
            self._delay.start()

    def deactivate(self) -> None:
        """Stop the CAN listener."""
        if self._delay:
            self._delay.stop()

    # The scenario.

    def _run_scenario(self) -> None:
        self._take()
        p = self.parameters
        if self._begin is None:
            if self._now() - self._waiting_since > p.start_timeout:
                raise ConfigError(f"no message on truth/tip for {p.start_timeout:g} s: is virtual_robot running on the same bus?")
            return
        elapsed = self._now() - self._begin
        if not self._released:
            self._released = p.relax_time == 0.0 or self._relax.succeeds()
            self._phase = "sagging" if self._released and p.relax_time > 0.0 else "waiting for the controller"
        if self._released and elapsed >= p.relax_time and self._compensated_at is None and self._begins():
            self._phase, self._compensated_at = "compensating", self._now()
        if elapsed >= p.duration:
            self._check_compensated()
            self._phase = "done"
            self._write(self._figures())
            self.finished = True

    def _begins(self) -> bool:
        """Begin compensation, of the controller or, once the bridge has stopped, of the board; return whether it has begun."""
        if self._stop is None:
            return self._enable.succeeds()
        if not self._stop.succeeds():
            return False
        with BoardClient(self._can()) as board:
            answer = board.ask(requests.act("run"))
        if not answer.done:
            raise ConfigError(f"the board does not run its loop: {answer.result}")
        return True

    def _check_compensated(self) -> None:
        """Raise ConfigError at the end of a run without compensation: its figures would be those of the sag."""
        if self._compensated_at is None and self.parameters.duration > self.parameters.relax_time:
            call = (self._stop or self._enable) if self._released else self._relax
            answer = f"the answer is '{call.refusal}'" if call.refusal else "the service has not answered"
            raise ConfigError(f"compensation has not begun: {call.service}: {answer}")
        if self._fault is not None and not self.parameters.standalone:  # there the board drives them
            raise ConfigError(f"compensation has ended: the bridge drives no motor: {self._fault}")

    def _observe(self) -> None:
        """Query the lifecycle states and write the state of the run to the result file."""
        for name, client in self._state_clients.items():
            if client.service_is_ready():
                client.call_async(GetState.Request()).add_done_callback(lambda future, name=name: self._on_state(name, future))
            elif name in self._states:
                self._states[name] = "lost"
        if self._phase != "done":
            self._write({})

    def _on_state(self, name: str, future: Future) -> None:
        answer = future.result()
        if answer is not None:
            self._states[name] = answer.current_state.label

    def _take(self) -> None:
        """Read the messages since the last call; the first ground truth starts the run."""
        for polled, track, values in self._sources:
            for received in polled.take_all():
                track.add(_seconds(received.message), *values(received.message))
        shape = self._deformation.take()  # the last one is enough for a share of the time
        if shape is not None:
            self._by_full_model.add(_seconds(shape.message), float(shape.message.model == "full"))
        status = self._status.take()
        if status is not None and status.message.holdable:
            self._unholdable = status.message.hold_message if status.message.holdable == Holdable.NO else None
        cables = self._cables.take()
        if cables is not None:
            self._fault = cables.message.message if cables.message.state == CableState.FAULT else None
        if self._begin is None and len(self._truth_tip):
            self._begin = self._now()

    # The figures.

    def _figures(self) -> dict:
        p = self.parameters
        end = self._begin + p.duration
        # The last third of the time with released cables, when the robot is at rest.
        at_rest = self._begin + 2.0 / 3.0 * p.relax_time
        released_until = self._begin + p.relax_time
        counted_from = (self._compensated_at or end) + p.settle_time
        residual = figures.residual(self._truth_tip, self._target, self._direction, counted_from, end)
        _, gravity = self._truth_gravity.between(counted_from, end)
        delays = 1e3 * np.array(self._delay.delays) if self._delay and self._delay.delays else None
        seed = None if p.seed < 0 else p.seed
        error = figures.gravity_error(self._truth_gravity, self._gravity, self._begin, end)
        released = released_tip_error(self.robot_file, gravity, self._target, seed)
        held, moving = figures.held_and_moving(
            self._truth_tip, self._truth_gravity, self._target, self._direction, counted_from, end
        )
        started = self._compensated_at or end
        sag = figures.sag(self._truth_tip, self._target, at_rest, released_until)
        # Until the counted time begins, the demo's base rests.
        settled = figures.settled(self._truth_tip, self._target, self._direction, started, counted_from, sag) if sag else None
        return {
            "sag_mm": _mm(sag),
            "residual_lateral_mm": _mm(residual and residual[0]),
            "residual_axial_mm": _mm(residual and residual[1]),
            "tip_error_with_mm": _mm(residual and float(np.hypot(*residual))),
            "tip_error_without_mm": _mm(released),
            "held_lateral_mm": _mm(held),
            "held_lateral_pct": _pct(held, released),
            "moving_lateral_mm": _mm(moving),
            "moving_lateral_pct": _pct(moving, released),
            "settle_s": _rounded(settled, 2),
            "unholdable": self._unholdable,
            "correlation": _rounded(figures.correlation(self._truth_tip, self._model_tip, self._begin, end), 5),
            "imu_rate_hz": _rounded(figures.rate(self._imu.between(counted_from, end)[0]), 2),
            # The controller's commands have no effect while the board runs its own loop.
            "command_rate_hz": None if p.standalone else _rounded(figures.rate(self._commands.between(counted_from, end)[0]), 2),
            "delay_ms": None
            if delays is None
            else {"median": _rounded(float(np.median(delays)), 2), "p99": _rounded(float(np.percentile(delays, 99)), 2)},
            "full_model_pct": _rounded(figures.share(self._by_full_model, counted_from, end), 1),
            "gravity_error_deg": _rounded(None if error is None else float(np.degrees(error)), 3),
        }

    def _write(self, result: dict) -> None:
        if not self.parameters.result_file:
            return
        last = self._truth_tip.values[-1] if len(self._truth_tip) else None
        state = {
            "phase": self._phase,
            "time": self._now(),
            "elapsed": 0.0 if self._begin is None else self._now() - self._begin,
            "tip_error_mm": None if last is None else _mm(float(np.linalg.norm(last - self._target))),
            "nodes": self._states,
            "figures": result,
        }
        write_whole(Path(self.parameters.result_file), json.dumps(state))

    def _can(self) -> CanInterface:
        p = self.parameters
        return self.robot_file.hardware.on(p.interface, p.channel).board_bus

    def _now(self) -> float:
        return self.get_clock().now().nanoseconds * 1e-9


def _seconds(message: Any) -> float:
    return Time.from_msg(message.header.stamp).nanoseconds * 1e-9


def _position(message: PoseStamped) -> tuple[float, float, float]:
    return message.pose.position.x, message.pose.position.y, message.pose.position.z


def _vector(message: Vector3Stamped) -> tuple[float, float, float]:
    return message.vector.x, message.vector.y, message.vector.z


def _mm(metres: float | None) -> float | None:
    return _rounded(None if metres is None else 1e3 * metres, 3)


def _pct(part: float | None, whole: float | None) -> float | None:
    return None if part is None or not whole else _rounded(100.0 * part / whole, 2)


def _rounded(value: float | None, digits: int) -> float | None:
    return None if value is None else round(value, digits)


def main() -> int:
    """Run the node; return the exit code."""
    return run(Judge)


if __name__ == "__main__":
    sys.exit(main())
