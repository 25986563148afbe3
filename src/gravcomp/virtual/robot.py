"""The whole virtual robot behind its CAN frames, as a host on its buses sees it; time advances only by `step`.

    robot = VirtualRobot(parameters, description, hardware, seed=1, motion=StaticMotion(base_orientation(0.0)))
    frames_out = robot.step(0.002, frames_in)
    robot.truth.tip_position

Time is counted in ticks of 0.5 ms (motors); rod, feedback and IMU follow at their own multiples. The same seed and the same
frames at the same times give the same run, bit for bit. With several buses the frames carry the name of theirs in `channel`.
"""

from collections.abc import Iterable
from typing import Any

import can
import numpy as np

from gravcomp.canbus import c610
from gravcomp.canbus.codec import FrameError, decode
from gravcomp.config import ConfigError
from gravcomp.description import Robot
from gravcomp.description.hardware import Hardware
from gravcomp.firmware.host_board import HostBoard
from gravcomp.motors.encoder import stays_countable
from gravcomp.scene.scene import Scene
from gravcomp.standard_gravity import STANDARD_GRAVITY
from gravcomp.virtual.active_faults import ActiveFaults
from gravcomp.virtual.base import MovingBase
from gravcomp.virtual.board import STATUS_PERIOD, VirtualBoard
from gravcomp.virtual.body import build_friction, build_material, build_rod
from gravcomp.virtual.bystander import Bystander
from gravcomp.virtual.draw import draw
from gravcomp.virtual.dynamics import MovingRod
from gravcomp.virtual.emulated_board import LOOP_FRAMES, EmulatedBoard
from gravcomp.virtual.equilibrium import equilibrium
from gravcomp.virtual.faults import Fault
from gravcomp.virtual.frame_faults import FrameFaults
from gravcomp.virtual.imu_chip import SAMPLE_PERIOD
from gravcomp.virtual.motion import BaseMotion, StaticMotion, base_orientation, quaternion
from gravcomp.virtual.motors import TICK, MotorBank
from gravcomp.virtual.parameters import VirtualRobotParameters
from gravcomp.virtual.surroundings import RodSurroundings
from gravcomp.virtual.truth import Truth

_ROD_TICKS = 4  # 2 ms
_SAMPLE_TICKS = round(SAMPLE_PERIOD / TICK)
_STATUS_TICKS = round(STATUS_PERIOD / TICK)
_TIP = np.ones(1)  # station
_GRAVITY = np.array([0.0, 0.0, -STANDARD_GRAVITY])


class VirtualRobot:
    """The virtual robot: rod, motors, board and base, stepped together. Attribute bystander: a user's hand and wall."""

    def __init__(
        self,
        parameters: VirtualRobotParameters,
        robot: Robot,
        hardware: Hardware,
        seed: int | None = None,
        motion: BaseMotion | None = None,
        board: str = "virtual",
        scene: Scene | None = None,
        model: bytes | None = None,
    ):
        """Start in the static equilibrium.

        `seed` replaces the one of the parameters; it also decides what they do not give. Without `motion` the base is at rest and
        the robot horizontal; `board`: 'virtual', Python code, 'emulated', the firmware's, or 'standalone', the firmware's with
        the loop on the board, whose blob is `model`; `scene`: walls around the robot, whose world begins where the base is at
        first. Where the robot in equilibrium would lie in a wall it starts unloaded. Raises ConfigError where the motors do not
        match the cables, where the parameters describe no robot, where the rod cannot represent it, and where the unloaded robot
        is in a wall.
        """
        if hardware.cables != robot.cable_names:
            raise ConfigError(f"motors for the cables {', '.join(hardware.cables)}; the robot has {', '.join(robot.cable_names)}")
        self.true = true = draw(parameters, robot, hardware, seed)
        # One generator for each part: an additional fault does not change the noise of the IMU.
        streams = np.random.SeedSequence(true.seed).spawn(4)
        motors, imu, faults = (np.random.default_rng(stream) for stream in streams[1:])
        self._robot, self._hardware = robot, hardware
        self._model = build_rod(true)
        around = RodSurroundings.of(self._model, true, scene) if scene else None
        self._rod = MovingRod(self._model, build_material(self._model, true), build_friction(true), around)
        self.bystander = Bystander(self._rod, true, around, scene.names if scene else ())
        self._motors = MotorBank(true.motors, hardware, true.cables.slack, motors)
        self._board: VirtualBoard | EmulatedBoard = (
            VirtualBoard(true.board, imu) if board == "virtual" else EmulatedBoard(true.board, imu, hardware, model)
        )
        self._base = MovingBase(
            motion or StaticMotion(base_orientation(0.0)),
            robot.imu_mount.rotation,
            np.array(robot.imu_mount.position),
            _GRAVITY,
            _ROD_TICKS * TICK,
            _SAMPLE_TICKS // _ROD_TICKS,
        )
        self._push = np.zeros(3)  # N in soft_base, at the tip
        self._outward, self._inward = FrameFaults(faults), FrameFaults(faults)
        self._faults = ActiveFaults(hardware)
        self._tick = 0
        self._elapsed = 0.0
        self._bus_index = {bus.name: index for index, bus in enumerate(hardware.all_buses)}
        self._bus_names = [bus.name or None for bus in hardware.all_buses]
        self._bus_of_motor = [hardware.bus_index(motor) for motor in hardware.motors]
        self._board_bus = self._bus_index[hardware.board_bus.name]
        self._feedback_ticks = round(1.0 / parameters.motors.feedback_rate / TICK)
        self.refused = 0  # frames that could not be decoded
        self.unresolved = 0  # steps of the rod that did not converge
        orientation, position = self._base.pose
        shape = equilibrium(self._model, orientation.T @ _GRAVITY, displacement=self._motors.wound)
        depth, _ = self._rod.place_free_of_walls(shape, orientation, position)
        if depth > 0.0:
            depth, obstacle = self._rod.place_free_of_walls(equilibrium(self._model, np.zeros(3)), orientation, position)
            if scene is not None and depth > 0.0:
                raise ConfigError(
                    f"the virtual robot starts {1e3 * depth:.3g} mm inside '{scene.names[obstacle]}' of the scene; move"
                    " the wall, or start elsewhere"
                )

    @property
    def time(self) -> float:
        """Time since the start, s."""
        return self._tick * TICK

    @property
    def feedback_period(self) -> float:
        """Time between two feedback frames of a motor, s."""
        return self._feedback_ticks * TICK

    @property
    def faults(self) -> tuple[Fault, ...]:
        """Faults that act at present."""
        return self._faults.all

    @property
    def firmware(self) -> HostBoard:
        """The board's C code, of a robot whose board is not 'virtual'."""
        assert isinstance(self._board, EmulatedBoard)
        return self._board.firmware

    def turn_base(self, orientation: np.ndarray) -> None:
        """Turn the base to `orientation` (3, 3), world from soft_base, and keep it there; this ends the motion that it had."""
        self._base.turn(orientation, self.time)

    def push(self, force: np.ndarray) -> None:
        """Let a force (3,) in N, constant in soft_base, act at the tip from now on; 0: none."""
        self._push = np.asarray(force, dtype=float)

    def attach(self, mass: float) -> None:
        """Fix a payload of `mass` kg to the middle of the tip, in addition to the described one."""
        self._rod.attach(mass)

    def inject(self, fault: Fault) -> None:
        """Begin `fault`. Raises ConfigError for an unknown cable."""
        self._faults.check(fault)
        if fault.kind == "board_restart":
            self._board.restart()
        elif fault.kind == "encoder_jump":
            self._motors.jump(self._faults.concerned_motors(fault))
        else:
            self._faults.add(fault, self.time)
            self._apply_faults()

    def clear_faults(self) -> None:
        """End all faults; broken cables are whole again."""
        self._faults.clear()
        self._apply_faults()

    def step(self, dt: float, frames: Iterable[can.Message] = ()) -> list[can.Message]:
        """Take the frames of the host, advance by `dt` s, and return the frames sent meanwhile, in order of time.

        Time advances by whole ticks; the rest counts for the next call. The timestamps of the frames are in virtual time.
        """
        for frame in self._inward.through(list(frames), self.time, self._faults.of_frames):
            self._receive(frame)
        self._elapsed += dt
        ticks = int(self._elapsed / TICK + 1e-6)
        self._elapsed -= ticks * TICK
        end = self._tick + ticks
        sent: list[can.Message] = []
        while self._tick < end:
            contact, spring = self._rod.capstan_springs  # the rod answers once a step
            due = min(end, *(self._tick - self._tick % period + period for period in (_ROD_TICKS, self._feedback_ticks)))
            self._motors.step(due - self._tick, contact, spring)
            self._tick = due
            if self._faults.end(self.time):
                self._apply_faults()
            sent += self._outward.through(self._act(), self.time, self._faults.of_frames)
        return sent

    def keeps_turns(self, duration: float) -> bool:
        """Return whether a host can still count the turns of all motors, as they turn, after `duration` s without frames."""
        return all(stays_countable(speed, duration) for speed in self._motors.rotor_speed.tolist())

    def skip(self, duration: float) -> float:
        """Let time pass without computing it, in whole sample periods of the IMU, and return how much passed (s).

        The base continues its motion, a steered one at its angular velocity, and the rod moves with it without changing its
        shape. The clock of the board continues and its samples are lost; the motors do not turn. For a host this is a bus on
        which frames were lost: stamps and rates still agree with the motion.
        """
        samples = int(duration / SAMPLE_PERIOD)
        if samples < 1:
            return 0.0
        self._tick += samples * _SAMPLE_TICKS
        self._rod.carry(*self._base.skip(self.time))
        self._board.skip(samples)
        return samples * SAMPLE_PERIOD

    @property
    def truth(self) -> Truth:
        """Ground truth at present."""
        base = self._rod.orientation[0]
        position, orientation = self._rod.along(self._robot.effectors.backbone_station)
        tip_position, tip_orientation = self._rod.along(_TIP)
        touches = self._rod.touches
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
            recorded=self._base.recorded,
            base_position=self._rod.position[0].copy(),
            contact_force=touches.force @ base,
            contact_depth=touches.depth,
            contact_place=(touches.place - self._rod.position[0]) @ base,
            contact_obstacle=self.bystander.names(touches.row),
            hand_force=self.bystander.hand.force,
            wall=self.bystander.plane,
        )

    def _receive(self, frame: can.Message) -> None:
        try:
            name, values = decode(frame)
        except FrameError:
            if isinstance(self._board, EmulatedBoard) and frame.arbitration_id in LOOP_FRAMES:
                self._board.receive(frame)
            else:
                self.refused += 1
            return
        bus = self._bus_index.get(str(frame.channel), self._board_bus)
        if bus != self._board_bus or not self._board.between:
            self._drive(bus, name, values)
        if bus == self._board_bus and isinstance(self._board, EmulatedBoard):
            self._board.receive(frame)
        elif name == "HeaterCommand":
            self._board.command_heater(values.duty)

    def _drive(self, bus: int, name: str, values: Any) -> None:
        """Let the motors of a bus take a decoded frame."""
        currents = c610.currents_of(name, values)
        for index, motor in enumerate(self._hardware.motors):
            if motor.can_id in currents and self._bus_of_motor[index] == bus:
                self._motors.commanded[index] = currents[motor.can_id]

    def _act(self) -> list[can.Message]:
        """Do what is due at this tick and return the frames that are sent."""
        sent: list[can.Message] = []
        if self._tick % _ROD_TICKS == 0:
            orientation, position = self._base.advance(self.time)
            self._rod.load[-1] = orientation @ (self._push + self.bystander.step(_ROD_TICKS * TICK, self.time))
            self.unresolved += not self._rod.step(_ROD_TICKS * TICK, orientation, position, _GRAVITY, self._motors.wound)
        behind: list[can.Message] = []  # frames of motors that the board passes on
        if self._tick % self._feedback_ticks == 0:
            for motor, bus, values in zip(self._hardware.motors, self._bus_of_motor, self._motors.feedback()):
                frame = c610.feedback(motor.can_id, **values)
                frame.channel = self._bus_names[bus]
                (behind if self._board.between and bus == self._board_bus else sent).append(frame)
        own = self._of_emulated(self._board, behind) if isinstance(self._board, EmulatedBoard) else []
        if self._tick % _SAMPLE_TICKS == 0:
            rate, force = self._base.imu(self.time)
            own += self._board.sample(rate, force, self._base.recorded)
        if self._tick % _STATUS_TICKS == 0 and isinstance(self._board, VirtualBoard):
            own.append(self._board.status())
        for frame in own:
            frame.channel = self._bus_names[self._board_bus]
        sent += own
        for frame in sent:
            frame.timestamp = self.time
        return sent

    def _of_emulated(self, board: EmulatedBoard, behind: list[can.Message]) -> list[can.Message]:
        """Let the firmware run until now with the frames of the motors behind it. Return its frames to the host."""
        board.feedback(behind)
        board.advance(self.time)
        for frame in board.to_motors():
            self._drive(self._board_bus, *decode(frame))
        return board.to_host()

    def _apply_faults(self) -> None:
        """Bring motors, cables and board into the state that the active faults demand."""
        faults = self._faults.all
        kinds = {fault.kind for fault in faults}
        self._motors.stalled[:] = False
        self._rod.tendon_stiffness[:] = self._model.tendon_stiffness
        for fault in faults:
            if fault.kind == "stall":
                self._motors.stalled |= self._faults.concerned_motors(fault)
            elif fault.kind == "cable_break":
                self._rod.tendon_stiffness[self._faults.concerned(fault)] = 0.0
        chip = self._board.chip
        chip.imu_fault = next((k for k in ("silent", "invalid", "saturated", "stuck") if f"imu_{k}" in kinds), None)
        chip.heater_fault = next((k for k in ("dead", "stuck_on") if f"heater_{k}" in kinds), None)
        chip.temperature_stuck = "temperature_stuck" in kinds
