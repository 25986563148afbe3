"""Test bench for gravcomp.motors: a bridge and six geared motors on springs, connected by CAN frames."""

import copy
import math
import random

from gravcomp.canbus import codec
from gravcomp.description.hardware import COUNTS_PER_TURN, Drive, Hardware, Motor
from gravcomp.motors.bridge import Bridge
from gravcomp.motors.state import State

HARDWARE = Hardware(motors=tuple(Motor(f"c{i}", i, direction=1 if i % 2 else -1) for i in range(1, 7)))
STEP = 5e-4  # s


class SpringMotor:
    """A motor with friction that pulls a spring by a cable, which is taut from the displacement `taut` (m) on."""

    def __init__(self, motor: Motor, drive: Drive, *, friction: float = 0.1, taut: float = 0.002, stiffness: float = 2000.0):
        self.motor, self.drive, self.friction, self.taut, self.stiffness = motor, drive, friction, taut, stiffness
        self.start = self.angle = random.uniform(0, 2 * math.pi)  # rad, of the capstan
        self.speed = self.current = 0.0
        self.blocked = self.silent = False
        self.sent_id, self.bus = motor.can_id, motor.bus

    @property
    def displacement(self) -> float:
        return self.motor.direction * (self.angle - self.start) * self.drive.capstan_radius

    def step(self) -> None:
        drive = self.drive
        tension = max(0.0, self.stiffness * (self.displacement - self.taut))
        torque = drive.torque_constant * self.current - self.motor.direction * tension * drive.capstan_radius - 2e-3 * self.speed
        friction = self.friction * drive.torque_constant
        if self.blocked or (self.speed == 0.0 and abs(torque) < 1.2 * friction):
            self.speed = 0.0
            return
        sense = math.copysign(1.0, self.speed or torque)
        faster = self.speed + (torque - sense * friction) / 1.0e-3 * STEP  # 1e-3 kg m^2 at the output
        self.speed = faster if self.speed * faster >= 0 else 0.0
        self.angle += self.speed * STEP

    def feedback(self):
        counts = self.angle * self.drive.gear_ratio / (2 * math.pi) * COUNTS_PER_TURN
        rpm = round(self.speed * self.drive.gear_ratio * 60 / (2 * math.pi))
        frame = codec.encode(
            f"MotorFeedback{self.sent_id}", angle=math.floor(counts) % COUNTS_PER_TURN, speed=rpm, current=self.current
        )
        frame.channel = self.bus
        return frame


class Bench:
    """Bridge and motors in virtual time: feedback 500 Hz, control 250 Hz, commands and IMU 100 Hz."""

    def __init__(self, hardware: Hardware = HARDWARE, *, motors: dict | None = None, **bridge):
        random.seed(3)
        self.hardware, self.now, self._step = hardware, 10.0, 0
        self.motors = [SpringMotor(m, hardware.drive, **(motors or {})) for m in hardware.motors]
        self.bridge = Bridge(hardware, **bridge)
        self.imu = True
        self.down = {}  # reasons by the name of each bus that carries no frames
        self.board_bus = hardware.board_bus.name or None
        self.largest_current = 0.0  # A, in all frames so far
        self.states = []

    def start(self) -> "Bench":
        self.bridge.configure()
        self.bridge.activate(self.now)
        self.run(0.4)
        return self

    def run(self, duration: float, command=None) -> None:
        """Run for `duration` (s). `command(time since the call)` returns displacements; None: no commands."""
        begin = self.now
        for _ in range(round(duration / STEP)):
            self._step += 1
            self.now += STEP
            for motor in self.motors:
                motor.step()
            if self._step % 4 == 0:
                for motor in self.motors:
                    if not motor.silent and motor.bus not in self.down:
                        self.bridge.on_frame(motor.feedback(), self.now)
            if self._step % 20 == 0:
                board = codec.encode("HeaterCommand", duty=0.0, sequence=0)  # any frame: only its bus counts
                board.channel = self.board_bus
                if self.imu and self.board_bus not in self.down and self.bridge.on_board_frame(board, self.now):
                    self.bridge.on_imu_sample(self.now)
                if command is not None:
                    self.bridge.command(command(self.now - begin), [], self.now)
            if self._step % 8 == 0:
                self.bridge.buses_down(self.down)
                self.deliver(self.bridge.tick(self.now))
                self.states.append((self.now, self.bridge.state))

    def deliver(self, frames) -> None:
        for frame in frames:
            for name, current in codec.decode(frame).values._asdict().items():
                self.largest_current = max(self.largest_current, abs(current))
                for motor in self.motors:
                    if name == f"current_{motor.motor.can_id}" and motor.bus == frame.channel and motor.bus not in self.down:
                        motor.current = current

    def since(self, begin: float, state) -> float:
        """Return the time (s) from `begin` until the bridge was first in this state."""
        return next(t for t, s in self.states if t >= begin and s is state) - begin


_FOLLOWING: dict[tuple, tuple[Bench, tuple]] = {}  # benches as they are left in the cache, each with the state of `random`


def bench_that_follows(goal: list[float], hardware: Hardware = HARDWARE) -> Bench:
    """Return a bench that has been started and has followed `goal` for 1.2 s: a copy of one that is computed once."""
    key = (tuple(goal), repr(hardware))
    if key not in _FOLLOWING:
        bench = Bench(hardware).start()
        bench.run(1.2, lambda t: goal)
        assert bench.bridge.state is State.ACTIVE
        _FOLLOWING[key] = bench, random.getstate()
    bench, state = _FOLLOWING[key]
    random.setstate(state)
    return copy.deepcopy(bench, {id(bench.hardware): bench.hardware})
