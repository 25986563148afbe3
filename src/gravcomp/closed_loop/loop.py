"""The whole closed loop in one process, stepped in the virtual robot's time: as fast as the machine computes, the same run each time.

    virtual robot --CAN frames--> IMU stream -> orientation filter -> simulator -> inverse problem -> bridge --CAN frames--> virtual robot

Every part is the one that runs in the graph: frames, bridge state machine, position loops and filter; only the middleware between
them is missing, whose delay `delay` stands for. The truth of the virtual robot is recorded for judging and never enters the loop.

    loop = ClosedLoop(setup, StaticMotion(base_orientation(0.0)))
    loop.release(); loop.run(4.0)
    loop.hold(target); loop.run(6.0)
    loop.trace.tip_position
"""

import collections
import dataclasses
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from gravcomp.canbus import codec
from gravcomp.canbus.imu_stream import IMU_FRAMES, ImuSample, ImuStream
from gravcomp.closed_loop.setup import Setup
from gravcomp.inverse import InverseController, Target
from gravcomp.inverse.limits import within_limits
from gravcomp.motors.bridge import Bridge
from gravcomp.motors.state import DRIVING
from gravcomp.orientation import GravityEstimator, Problem
from gravcomp.orientation import quaternion as quat
from gravcomp.simulation import Shape, Simulator
from gravcomp.thermal import HeaterControl
from gravcomp.virtual.motion import BaseMotion
from gravcomp.virtual.robot import VirtualRobot

SAMPLE_PERIOD = 0.010  # s
_BUS_STEP = 0.002  # s: the motors' feedback
_CONTROL_STEPS = 2  # bus steps a control period of the bridge: 250 Hz
_HEATER_PERIOD = 0.1  # s
_IDLE = 2e-3  # N
RELEASE_SLACK = 5e-3
"""m: released cables are paid out so far beyond their paths that nothing of the robot ever tightens them."""


@dataclass(frozen=True)
class Trace:
    """What happened, one row a sample; t samples, b backbone points, m cables. SI, soft_base; `model_` is what the simulator says."""

    time: np.ndarray  # (t,)
    compensating: np.ndarray  # (t,) bool
    tip_position: np.ndarray  # (t, 3) true
    tip_direction: np.ndarray  # (t, 3) true
    backbone: np.ndarray  # (t, b, 3) true
    base_orientation: np.ndarray  # (t, 4) x y z w, true
    gravity: np.ndarray  # (t, 3) true
    tension: np.ndarray  # (t, m) true
    estimated_gravity: np.ndarray  # (t, 3)
    model_tip_position: np.ndarray  # (t, 3)
    model_tip_direction: np.ndarray  # (t, 3)
    command: np.ndarray  # (t, m)

    def between(self, start: float, end: float = np.inf) -> "Trace":
        """The rows with start <= time < end."""
        rows = (self.time >= start - 1e-9) & (self.time < end - 1e-9)
        return Trace(*(getattr(self, name)[rows] for name in Trace.__dataclass_fields__))


class ClosedLoop:
    """The loop's state. Public: trace, time, shape (the simulator's last)."""

    def __init__(self, setup: Setup, motion: BaseMotion, *, delay: int = 0, heating: bool = True, warm: bool = True):
        """delay: samples between a command and its arrival at the bridge; heating: the temperature control runs; warm: the board
        starts at its target temperature and the filter has seen a rest.
        """
        self.setup = setup
        self._virtual = VirtualRobot(
            _truth(setup, warm and heating), setup.nominal, setup.hardware, seed=setup.seed, motion=motion
        )
        self._bridge = Bridge(setup.hardware, require_imu=False)
        self._stream = ImuStream()
        mount = quat.from_roll_pitch_yaw(*setup.robot.imu_mount.rpy)
        self._estimator = GravityEstimator(setup.estimator.estimator, mount)
        # A board that starts warm cannot tell the surroundings' temperature by its first reading.
        ambient = setup.truth.board.thermal.ambient if warm else setup.estimator.heater.ambient
        self._heater = HeaterControl(dataclasses.replace(setup.estimator.heater, ambient=ambient)) if heating else None
        self._simulator = Simulator(setup.robot)
        self._problem = InverseController(setup.robot, setup.controller.inverse)
        self._target: Target | None = None
        self._weightless = False
        self._cables = np.zeros(len(setup.robot.cables))  # what drives the model's
        self._sent = self._cables
        self._arriving: collections.deque = collections.deque([None] * delay)
        self._rows: list[tuple] = []
        self._outgoing: list = []
        self._steps = 0
        self._gravity = np.zeros(3)
        self.shape: Shape | None = None
        self._bridge.configure()
        self._bridge.activate(0.0)
        self._settle()

    @property
    def time(self) -> float:
        """s of the virtual robot's clock."""
        return self._virtual.time

    @property
    def trace(self) -> Trace:
        """What has happened since the beginning or `forget`."""
        return Trace(*(np.array(column) for column in zip(*self._rows)))

    def forget(self) -> None:
        """Begin a new trace."""
        self._rows.clear()

    def release(self) -> None:
        """Pay the cables out and leave the robot to gravity: 'without compensation'."""
        self._target = None

    def hold(self, target: Target, *, weightless: bool = False) -> None:
        """Compensate: keep the target. weightless: the model knows of no gravity and idle cables are released, without pretension, which is what
        bending the robot without compensation means.
        """
        if self._target is None:
            self._problem.reset(self._cables)
        options = self.setup.controller.inverse
        self._problem.options = dataclasses.replace(options, pretension=0.0) if weightless else options
        self._target, self._weightless = target, weightless

    def run(self, duration: float) -> None:
        """Advance by `duration` s."""
        end = self.time + duration
        while self.time < end - 1e-9:
            self._bus_step()

    def _settle(self) -> None:
        """Until the bridge drives and the filter has started."""
        self._waiting = True
        while self._bridge.state not in DRIVING or self.shape is None:
            self._bus_step()
            if self.time > 5.0:
                raise RuntimeError(f"the virtual robot's bridge does not start: {self._bridge.message}")
        self._waiting = False
        self.forget()

    def _bus_step(self) -> None:
        frames, self._outgoing = self._virtual.step(_BUS_STEP, self._outgoing), []
        now = self.time
        for frame in frames:
            if frame.arbitration_id not in IMU_FRAMES:
                self._bridge.on_frame(frame, now)
                continue
            sample = self._stream.on_frame(frame, now)
            if sample is not None:
                self._on_sample(sample)
        self._steps += 1
        if self._steps % _CONTROL_STEPS == 0:
            self._outgoing += self._bridge.tick(now)
        if self._heater is not None and self._steps % round(_HEATER_PERIOD / _BUS_STEP) == 0:
            self._outgoing.append(codec.encode("HeaterCommand", duty=self._heater.state.duty, sequence=self._steps // 50 % 256))

    def _on_sample(self, sample: ImuSample) -> None:
        stamp_ns = round(1e9 * sample.stamp)
        self._estimator.add_temperature(stamp_ns, sample.temperature)
        if self._heater is not None:
            self._heater.update(stamp_ns, sample.temperature)
        estimate = self._estimator.update(stamp_ns, sample.angular_rate, sample.specific_force)
        if not isinstance(estimate, Problem):
            self._gravity = np.array(estimate.gravity)
        released = self._target is None
        gravity = np.zeros(3) if self._weightless and not released else self._gravity
        self.shape = self._simulator.step(gravity, None if released else self._cables)
        self._cables, tension = self._released() if released else self._compensated()
        self._sent = self._idle_released(tension) if self._weightless and not released else self._cables
        self._arriving.append((self._sent, tension))
        arrived = self._arriving.popleft()
        if arrived is not None and not self._waiting:
            refused = self._bridge.command(arrived[0].tolist(), arrived[1].tolist(), self.time)
            if refused:
                raise RuntimeError(f"the bridge refused a command at {self.time:.2f} s: {refused}")
        self._record()

    def _released(self) -> tuple[np.ndarray, np.ndarray]:
        free = self.shape.response.displacement_free - RELEASE_SLACK
        displacement = (
            self._cables if self._waiting else within_limits(free, self._cables, self.setup.robot.limits, SAMPLE_PERIOD)
        )
        return displacement, np.zeros(len(free))

    def _compensated(self) -> tuple[np.ndarray, np.ndarray]:
        shape = self.shape
        command = self._problem.step(
            shape.response,
            self._target,
            backbone_station=shape.backbone_station,
            tension=shape.cable_tension,
            interval=SAMPLE_PERIOD,
            followed=shape.is_equilibrium,
        )
        return command.displacement, command.tension

    def _idle_released(self, tension: np.ndarray) -> np.ndarray:
        wanted = np.where(tension > _IDLE, self._cables, self._cables - RELEASE_SLACK)
        return within_limits(wanted, self._sent, self.setup.robot.limits, SAMPLE_PERIOD)

    def _record(self) -> None:
        truth, shape = self._virtual.truth, self.shape
        self._rows.append(
            (
                truth.time,
                self._target is not None,
                truth.tip_position,
                Rotation.from_quat(truth.tip_orientation).apply((0.0, 0.0, 1.0)),
                truth.backbone_position,
                truth.base_orientation,
                truth.gravity,
                truth.tension,
                self._gravity,
                shape.tip_position,
                shape.tip_direction,
                self._sent,
            )
        )


def _truth(setup: Setup, warm: bool):
    """The virtual robot's parameters; `warm`: the board starts at the heater's target."""
    truth = setup.truth
    if not warm:
        return truth
    heater, thermal = setup.estimator.heater, truth.board.thermal
    target = thermal.ambient + heater.rise if heater.target is None else heater.target
    thermal = dataclasses.replace(thermal, start=target)
    return dataclasses.replace(truth, board=dataclasses.replace(truth.board, thermal=thermal))
