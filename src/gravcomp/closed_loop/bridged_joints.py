"""A JointBridge with what is behind it: the stand-in controller and the servos, on the frames of the virtual robot.

    command --> JointBridge --trajectory, positions, efforts--> JointController --> ServoJoints --currents--> virtual robot
                            <----------- joint states --------------------------   <--feedback--

It has the methods of `motors.bridge.Bridge` that a closed loop needs.
"""

from collections.abc import Sequence

import can

from gravcomp.description.hardware import Hardware
from gravcomp.motors.joint_bridge import JointBridge
from gravcomp.motors.state import State
from gravcomp.virtual.joint_controller import JointController, TrajectoryPoint
from gravcomp.virtual.joint_servos import ServoJoints

_PERIOD = 0.004  # s, of bridge, controller and joint states


class BridgedJoints:
    """Bridge, controller and servos of `hardware.joints`. Attributes: bridge, controller, servos."""

    def __init__(self, hardware: Hardware):
        """Raises ValueError where joints and motors do not move the same cables."""
        assert hardware.joints is not None
        self.bridge, self.servos = JointBridge(hardware), ServoJoints(hardware)
        self._names = [motor.joint for motor in hardware.joints.motors]
        self.controller = JointController(self._names, hardware.joints.command)
        self._next = 0.0
        self._last = 0.0

    @property
    def state(self) -> State:
        """State of the bridge."""
        return self.bridge.state

    @property
    def message(self) -> str:
        """Reason of the state."""
        return self.bridge.message

    def configure(self) -> None:
        """Enter INACTIVE."""
        self.bridge.configure()

    def activate(self, now: float) -> None:
        """Wait for the joint states, then drive the joints."""
        self.bridge.activate(now)

    def on_frame(self, message: can.Message, now: float) -> None:
        """Take the feedback of a motor."""
        self.servos.on_frame(message, now)

    def command(self, displacement: Sequence[float], tension: Sequence[float], now: float) -> str | None:
        """Take a command, see `Supervisor.command`."""
        reason = self.bridge.command(displacement, tension, now)
        self._send(now)
        return reason

    def tick(self, now: float) -> list[can.Message]:
        """Run servos, and bridge and controller when they are due. Return the frames for the motors."""
        dt, self._last = now - self._last, now
        if self.servos.ready and now >= self._next:
            self._next = now + _PERIOD
            state = self.servos.state
            self.bridge.on_joint_states(self._names, state.angles, state.speeds, state.efforts, now)
            self._send(now)
        return self.servos.step(self.controller.wanted(now), dt)

    def _send(self, now: float) -> None:
        values = self.bridge.tick(now)
        if values is None:
            return
        if self.controller.command == "trajectory":
            point = TrajectoryPoint(values, [], 0.0)
            self.controller.on_trajectory(self._names, [point], None, now, self.servos.state.angles)
        else:
            self.controller.on_values(values)
