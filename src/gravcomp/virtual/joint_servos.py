"""Joints behind a stand-in controller: those of ros2_control's mock hardware, or the motors of the virtual robot as servos.

    MockJoints      the state is the command, as mock_components/GenericSystem has it
    ServoJoints     a servo at each C610 of the virtual robot: the position loop of `motors.loop` on the encoder of the motor

A servo knows nothing of the cables: it turns to the commanded angle, or exerts the commanded effort.
"""

import dataclasses
from collections.abc import Sequence

import can

from gravcomp.canbus import c610, codec
from gravcomp.description.hardware import Hardware
from gravcomp.motors.joint_scale import JointScale
from gravcomp.motors.loop import PositionLoop
from gravcomp.motors.output import BusOutputs
from gravcomp.motors.rotors import Rotors

_PROFILE = 2.0  # a servo's own limits of speed and acceleration over those of the cables: it smooths the steps of its commands


@dataclasses.dataclass(frozen=True)
class JointState:
    """Angles (rad), speeds (rad/s) and efforts (N m) of the joints, (k,) each."""

    angles: list[float]
    speeds: list[float]
    efforts: list[float]


class MockJoints:
    """Joints whose state is their command. `zeros` (k,) rad: angles at the start."""

    def __init__(self, zeros: Sequence[float]):
        self._state = JointState(list(zeros), [0.0] * len(zeros), [0.0] * len(zeros))

    @property
    def state(self) -> JointState:
        """State of the joints."""
        return self._state

    def step(self, wanted: Sequence[float] | None, dt: float) -> None:
        """Take the commanded angles (rad)."""
        if wanted is not None and dt > 0.0:
            speeds = [(after - before) / dt for before, after in zip(self._state.angles, wanted)]
            self._state = JointState(list(wanted), speeds, [0.0] * len(speeds))


class ServoJoints:
    """The motors of `hardware` as the joints of `hardware.joints`; their angles at the start are the zero positions."""

    def __init__(self, hardware: Hardware):
        """Raises ValueError where the joints do not move the cables that the motors move."""
        if hardware.joints is None or not (hardware.joint_transmission.matrix == hardware.transmission.matrix).all():
            raise ValueError("the joints of hardware.joints and the motors of hardware.motors must move the same cables")
        self._by_effort = hardware.joints.command == "effort"
        self._motors, self._drive = hardware.joints.motors, hardware.drive
        self._scales = [JointScale(motor, hardware.drive) for motor in self._motors]
        for scale in self._scales:
            scale.zero = scale.zero or 0.0
        self._rotors, self._output = Rotors(hardware), BusOutputs(hardware)
        self._index = {(hardware.bus_index(motor), motor.can_id): i for i, motor in enumerate(hardware.motors)}
        self._buses = {bus.name: index for index, bus in enumerate(hardware.all_buses)}
        self._directions = [motor.direction for motor in hardware.motors]
        profile = dataclasses.replace(
            hardware.drive,
            velocity_limit=_PROFILE * hardware.drive.velocity_limit,
            acceleration_limit=_PROFILE * hardware.drive.acceleration_limit,
        )
        self._loops = [PositionLoop(profile, two_way=True) for _ in self._motors]
        self._started = False

    @property
    def ready(self) -> bool:
        """Whether every motor has answered."""
        return None not in self._rotors.counts()

    @property
    def state(self) -> JointState:
        """State of the joints."""
        angles = [scale.angle(u) for scale, u in zip(self._scales, self._rotors.displacement())]
        radii = [scale.radius(angle) for scale, angle in zip(self._scales, angles)]
        signs = [motor.direction for motor in self._motors]
        return JointState(
            angles,
            [d * v / r for d, v, r in zip(signs, self._rotors.velocity(), radii)],
            [d * f * r for d, f, r in zip(signs, self._rotors.force(), radii)],
        )

    def on_frame(self, message: can.Message, now: float) -> None:
        """Take a frame of a motor; others are ignored."""
        motor_id = c610.motor_of(message.arbitration_id)
        index = None if motor_id is None else self._index.get((self._buses.get(str(message.channel), 0), motor_id))
        if index is None:
            return
        try:
            feedback = codec.decode(message).values
        except codec.FrameError:
            return
        self._rotors.on_feedback(index, feedback.angle, feedback.speed, feedback.current, now)

    def step(self, wanted: Sequence[float] | None, dt: float) -> list[can.Message]:
        """Return the frames with the currents for the commanded angles (rad) or efforts (N m); none before all have answered."""
        if not self.ready:
            return []
        if not self._started:
            self._started = True
            self._rotors.zeros.fill(self._rotors.counts())
            for loop, displacement in zip(self._loops, self._rotors.displacement()):
                loop.reset(displacement)
        if wanted is None:
            return self._output.zero()
        return self._output.frames([d * i for d, i in zip(self._directions, self._currents(wanted, dt))], enabled=True)

    def _currents(self, wanted: Sequence[float], dt: float) -> list[float]:
        displacement, velocity = self._rotors.displacement(), self._rotors.velocity()
        if self._by_effort:
            return [
                motor.direction * effort / scale.radius(scale.angle(u)) / self._drive.tension_per_ampere
                for motor, scale, effort, u in zip(self._motors, self._scales, wanted, displacement)
            ]
        return [
            loop.step(scale.displacement(angle), 0.0, u, v, dt)
            for loop, scale, angle, u, v in zip(self._loops, self._scales, wanted, displacement, velocity)
        ]
