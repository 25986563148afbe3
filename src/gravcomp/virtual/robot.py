"""The whole virtual robot behind its CAN frames: what a host on the bus would meet, stepped in time without any clock of its own.

    robot = VirtualRobot(parameters, description, hardware, seed=1, motion=StaticMotion(base_orientation(0.0)))
    frames_out = robot.step(0.002, frames_in)
    robot.truth.tip_position

Time goes in ticks of 0.5 ms (motors); rod, feedback and IMU follow at their own multiples. The same seed and the same frames
at the same times give the same run, bit for bit.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import can
import numpy as np

from gravcomp.canbus.bmi088 import STANDARD_GRAVITY
from gravcomp.canbus.codec import FrameError, decode, encode
from gravcomp.config import ConfigError
from gravcomp.description import Robot
from gravcomp.description.hardware import Hardware
from gravcomp.virtual.board import SAMPLE_PERIOD, STATUS_PERIOD, VirtualBoard
from gravcomp.virtual.body import build_friction, build_material, build_rod
from gravcomp.virtual.dynamics import MovingRod
from gravcomp.virtual.equilibrium import equilibrium
from gravcomp.virtual.faults import Fault, FrameFaults
from gravcomp.virtual.motion import BaseMotion, FollowedMotion, StaticMotion, base_orientation, quaternion
from gravcomp.virtual.motors import TICK, MotorBank
from gravcomp.virtual.parameters import VirtualRobotParameters
from gravcomp.virtual.se3 import rotation_log

_ROD_TICKS = 4  # 2 ms
_SAMPLE_TICKS = round(SAMPLE_PERIOD / TICK)
_STATUS_TICKS = round(STATUS_PERIOD / TICK)
_TIP = np.ones(1)  # station
_GRAVITY = np.array([0.0, 0.0, -STANDARD_GRAVITY])


@dataclass(frozen=True)
class Truth:
    """What is really so. Everything in soft_base, SI; b backbone points, m cables."""

    time: float  # s since the start
    tip_position: np.ndarray  # (3,)
    tip_orientation: np.ndarray  # (4,) x y z w
    backbone_position: np.ndarray  # (b, 3), at the stations of robot.effectors
    backbone_orientation: np.ndarray  # (b, 4)
    gravity: np.ndarray  # (3,) m/s^2
    base_orientation: np.ndarray  # (4,) world from soft_base
    displacement: np.ndarray  # (m,) wound in at the capstans
    shortened: np.ndarray  # (m,) by how much the paths in the robot are shorter
    tension: np.ndarray  # (m,) N, at the capstans
    current: np.ndarray  # (m,) A, as last commanded
    temperature: float  # degC, of the chip
    recorded: bool  # whether the last IMU sample came from a recording


class VirtualRobot:
    """The virtual robot. `seed` overrides the one of the parameters; without `motion` the base stands still, horizontally."""

    def __init__(
        self,
        parameters: VirtualRobotParameters,
        robot: Robot,
        hardware: Hardware,
        seed: int | None = None,
        motion: BaseMotion | None = None,
    ):
        if hardware.cables != robot.cable_names:
            raise ConfigError(f"motors for the cables {', '.join(hardware.cables)}; the robot has {', '.join(robot.cable_names)}")
        # One generator a part: a fault more does not change the IMU's noise.
        streams = np.random.SeedSequence(parameters.seed if seed is None else seed).spawn(4)
        start, motors, board, faults = (np.random.default_rng(stream) for stream in streams)
        self.motion: BaseMotion = motion or StaticMotion(base_orientation(0.0))
        self._robot, self._hardware = robot, hardware
        self._mount, self._imu_position = robot.imu_mount.rotation, np.array(robot.imu_mount.position)
        slack = parameters.tendons.slack + parameters.tendons.slack_spread * start.standard_normal(len(robot.cables))
        self._model = build_rod(robot, parameters)
        self._rod = MovingRod(self._model, build_material(self._model, parameters), build_friction(parameters))
        self._motors = MotorBank(parameters.motors, hardware, slack, motors)
        self._board = VirtualBoard(parameters.board, board)
        self._outward, self._inward = FrameFaults(faults), FrameFaults(faults)
        self._faults: list[tuple[Fault, float]] = []  # with the time of their end
        self._tick = 0
        self._elapsed = 0.0
        self._feedback_names = [f"MotorFeedback{motor.can_id}" for motor in hardware.motors]
        self._feedback_ticks = round(1.0 / parameters.motors.feedback_rate / TICK)
        self._recorded = False
        self.refused = 0  # frames that could not be decoded
        self.unresolved = 0  # steps of the rod that did not converge
        orientation, position = self.motion.pose(0.0)
        self._poses = [(orientation, position)] * (1 + _SAMPLE_TICKS // _ROD_TICKS)  # the last ones, one a step of the rod
        shape = equilibrium(self._model, orientation.T @ _GRAVITY, displacement=self._motors.wound)
        self._rod.rest(shape, orientation, position)

    @property
    def time(self) -> float:
        """s since the start."""
        return self._tick * TICK

    @property
    def feedback_period(self) -> float:
        """s between two feedbacks of a motor."""
        return self._feedback_ticks * TICK

    @property
    def faults(self) -> tuple[Fault, ...]:
        """Those that act now."""
        return tuple(fault for fault, _ in self._faults)

    def turn_base(self, orientation: np.ndarray) -> None:
        """Turn the base to `orientation` (3, 3), world from soft_base; from now on it is held, whatever its motion was before."""
        if not isinstance(self.motion, FollowedMotion):
            self.motion = FollowedMotion(*self._poses[-1], time=self.time)
        self.motion.follow(orientation)

    def inject(self, fault: Fault) -> None:
        """Let `fault` begin now. Raises ConfigError for an unknown cable."""
        if fault.cable and fault.cable not in self._hardware.cables:
            raise ConfigError(f"fault: cable is '{fault.cable}'; allowed: {', '.join(self._hardware.cables)}, or empty for all")
        if fault.kind == "board_restart":
            self._board.restart()
            return
        if fault.kind == "encoder_jump":
            self._motors.jump(self._concerned(fault))
            return
        self._faults.append((fault, self.time + fault.duration if fault.duration > 0.0 else np.inf))
        self._apply_faults()

    def clear_faults(self) -> None:
        """End all faults; broken cables are whole again."""
        self._faults.clear()
        self._apply_faults()

    def step(self, dt: float, frames: Iterable[can.Message] = ()) -> list[can.Message]:
        """Take the host's frames, advance by `dt` s (whole ticks; the rest is carried on), return the frames sent meanwhile,
        in order.

        Their timestamp is the virtual time.
        """
        for frame in self._inward.through(list(frames), self.time, self._frame_faults()):
            self._receive(frame)
        self._elapsed += dt
        ticks = int(self._elapsed / TICK + 1e-6)
        self._elapsed -= ticks * TICK
        end, sent = self._tick + ticks, []
        while self._tick < end:
            due = min(end, *(self._tick - self._tick % period + period for period in (_ROD_TICKS, self._feedback_ticks)))
            self._motors.step(due - self._tick, self._rod.shortened, self._rod.tendon_stiffness)
            self._tick = due
            self._end_faults()
            sent += self._outward.through(self._act(), self.time, self._frame_faults())
        return sent

    def skip(self, duration: float) -> float:
        """Let time pass that nobody computes, in whole periods of the IMU; returns how much passed (s).

        The base goes on as its motion says, or at its pace where it is steered, and takes the rod along as it is bent; the board's clock goes on, its samples are lost; the
        motors stand. To whoever listens it is a bus on which frames were lost, with stamps and rates that still fit the motion.
        """
        samples = int(duration / SAMPLE_PERIOD)
        if samples < 1:
            return 0.0
        self._tick += samples * _SAMPLE_TICKS
        last = len(self._poses) - 1
        pose = self.motion.coast if isinstance(self.motion, FollowedMotion) else self.motion.pose
        self._poses = [pose(self.time - (last - k) * _ROD_TICKS * TICK) for k in range(last + 1)]
        self._rod.carry(*self._poses[-1])
        self._board.skip(samples)
        return samples * SAMPLE_PERIOD

    @property
    def truth(self) -> Truth:
        """What is so now."""
        base = self._rod.orientation[0]
        position, orientation = self._rod.along(self._robot.effectors.backbone_station)
        tip_position, tip_orientation = self._rod.along(_TIP)
        return Truth(
            time=self.time,
            tip_position=tip_position[0],
            tip_orientation=tip_orientation[0],
            backbone_position=position,
            backbone_orientation=orientation,
            gravity=base.T @ _GRAVITY,
            base_orientation=quaternion(base),
            displacement=self._motors.wound,
            shortened=self._rod.shortened.copy(),
            tension=self._rod.tension.copy(),
            current=self._motors.commanded.copy(),
            temperature=self._board.temperature,
            recorded=self._recorded,
        )

    def _receive(self, frame: can.Message) -> None:
        try:
            name, values = decode(frame)
        except FrameError:
            self.refused += 1
            return
        if name.startswith("MotorCommand"):
            for index, motor in enumerate(self._hardware.motors):
                current = getattr(values, f"current_{motor.can_id}", None)
                if current is not None:
                    self._motors.commanded[index] = current
        elif name == "HeaterCommand":
            self._board.command_heater(values.duty)

    def _act(self) -> list[can.Message]:
        """What happens at this tick."""
        sent = []
        if self._tick % _ROD_TICKS == 0:
            orientation, position = self.motion.pose(self.time)
            self._poses = [*self._poses[1:], (orientation, position)]
            self.unresolved += not self._rod.step(_ROD_TICKS * TICK, orientation, position, _GRAVITY, self._motors.wound)
        if self._tick % self._feedback_ticks == 0:
            for name, values in zip(self._feedback_names, self._motors.feedback()):
                sent.append(encode(name, **values))
        if self._tick % _SAMPLE_TICKS == 0:
            sent += self._board.sample(*self._imu())
        if self._tick % _STATUS_TICKS == 0:
            sent.append(self._board.status())
        for frame in sent:
            frame.timestamp = self.time
        return sent

    def _imu(self) -> tuple[np.ndarray, np.ndarray, bool]:
        """Angular rate and specific force in imu_link, and whether they were measured."""
        measured = self.motion.imu(self.time, SAMPLE_PERIOD)
        self._recorded = measured is not None
        if measured is not None:
            return *measured, True
        turn = np.empty(3)
        rotation_log(np.ascontiguousarray(self._poses[0][0].T @ self._poses[-1][0]), turn)
        dt = _ROD_TICKS * TICK
        before, middle, after = (position + orientation @ self._imu_position for orientation, position in self._poses[-3:])
        acceleration = (after - 2 * middle + before) / dt**2
        force = self._poses[-2][0].T @ (acceleration - _GRAVITY)
        return self._mount.T @ turn / SAMPLE_PERIOD, self._mount.T @ force, False

    def _concerned(self, fault: Fault) -> np.ndarray:
        """(m,) bool: the cables that a fault concerns."""
        return np.array([fault.cable in ("", cable) for cable in self._hardware.cables])

    def _frame_faults(self) -> list[tuple[Fault, int | None]]:
        if not self._faults:
            return []
        ids = {motor.cable: 0x200 + motor.can_id for motor in self._hardware.motors}
        return [(fault, ids.get(fault.cable)) for fault, _ in self._faults]

    def _end_faults(self) -> None:
        if any(end <= self.time for _, end in self._faults):
            self._faults = [(fault, end) for fault, end in self._faults if end > self.time]
            self._apply_faults()

    def _apply_faults(self) -> None:
        """Bring motors, cables and board into the state that the faults acting now ask for."""
        kinds = {fault.kind for fault, _ in self._faults}
        self._motors.stalled[:] = False
        self._rod.tendon_stiffness[:] = self._model.tendon_stiffness
        for fault, _ in self._faults:
            if fault.kind == "stall":
                self._motors.stalled |= self._concerned(fault)
            elif fault.kind == "cable_break":
                self._rod.tendon_stiffness[self._concerned(fault)] = 0.0
        self._board.imu_fault = next((k for k in ("silent", "invalid", "saturated", "stuck") if f"imu_{k}" in kinds), None)
        self._board.heater_fault = next((k for k in ("dead", "stuck_on") if f"heater_{k}" in kinds), None)
        self._board.temperature_stuck = "temperature_stuck" in kinds
