"""The whole closed loop in one process, in virtual time: as fast as the machine computes, with the same result each time.

    virtual robot --CAN frames--> IMU stream -> orientation filter -> simulator -> inverse problem
                  <--CAN frames-- bridge <----------------------------------------------- command

All parts are those of the graph: frames, state machine of the bridge, position loops, filter. A robot with `hardware.joints` has
the bridge, controller and servos of `bridged_joints` in place of the CAN bridge. Only the middleware is missing; `delay`
represents its latency. The ground truth of the virtual robot is recorded for evaluation and does not enter the loop.

    loop = ClosedLoop(setup, StaticMotion(base_orientation(0.0)))
    loop.release(); loop.run(4.0)
    loop.hold(target); loop.run(6.0)
    loop.trace.tip_position
"""

import collections
import dataclasses

import can
import numpy as np
from scipy.spatial.transform import Rotation

from gravcomp.canbus import codec
from gravcomp.canbus.imu_stream import IMU_FRAMES, ImuSample, ImuStream
from gravcomp.closed_loop.bridged_joints import BridgedJoints
from gravcomp.closed_loop.load_finding import LoadFinding
from gravcomp.closed_loop.loop_failed import LoopFailed
from gravcomp.closed_loop.setup import Setup
from gravcomp.closed_loop.trace import Trace
from gravcomp.closed_loop.warm_board import warm_heater, with_warm_board
from gravcomp.external_loads.base_turn import BaseTurn
from gravcomp.firmware import requests
from gravcomp.firmware.model_fit import blob_for
from gravcomp.firmware.model_settings import LoopParameters
from gravcomp.graph.parameters.virtual_load_cells import VirtualLoadCellParameters
from gravcomp.graph.parameters.virtual_tracker import VirtualTrackerParameters
from gravcomp.inverse import Command, InverseController, Target
from gravcomp.inverse.limits import within_limits
from gravcomp.load_estimation import LoadEstimate, LoadEstimationOptions
from gravcomp.motors.bridge import Bridge
from gravcomp.motors.state import DRIVING
from gravcomp.orientation import GravityEstimator, Problem
from gravcomp.orientation import quaternion as quat
from gravcomp.simulation import Shape, Simulator
from gravcomp.thermal import HeaterControl
from gravcomp.tip_observer import TipObserver
from gravcomp.virtual.motion import BaseMotion
from gravcomp.virtual.robot import VirtualRobot
from gravcomp.virtual.tracker import VirtualTracker
from gravcomp.virtual.truth import Truth

SAMPLE_PERIOD = 0.010  # s
_BUS_STEP = 0.002  # s: the motors' feedback
_CONTROL_STEPS = 2  # bus steps in a control period of the bridge: 250 Hz
_HEATER_PERIOD = 0.1  # s
_STANDALONE = "standalone"  # the board on which the firmware's loop runs
_IDLE = 4e-4  # of the largest tension, below which a cable counts as idle
_RELEASE_SLACK = 0.05
"""Of the robot's length: released cables are paid out so far beyond their paths that no motion of the robot makes them taut."""


class ClosedLoop:
    """State of the loop. `shape` is the last result of the simulator, `command` that of the inverse problem."""

    def __init__(
        self,
        setup: Setup,
        motion: BaseMotion,
        *,
        delay: int = 0,
        heating: bool = True,
        warm: bool = True,
        tracker: VirtualTrackerParameters | None = None,
        load: LoadEstimationOptions | None = None,
        cells: VirtualLoadCellParameters | None = None,
        board: str = "virtual",
    ):
        """Start the bridge and the filter; virtual time advances until both run.

        delay: samples between a command and its arrival at the bridge; heating: the temperature control runs; warm: the board
        starts at its target temperature; tracker: of the tip, to correct the model's error; load: what to find of an unknown
        load; cells: load cells at the capstans; None: there is none; board: of the virtual robot, see there. From the first
        `hold` on the board "standalone" computes the commands and drives the motors by itself; the host then only listens, and
        its simulator follows the board's commands. It needs a reduced model. Raises LoopFailed where the bridge does not start,
        ConfigError for a robot that does not fit the board.
        """
        self.setup = setup
        self._virtual = VirtualRobot(
            with_warm_board(setup) if warm and heating else setup.truth,
            setup.nominal,
            setup.virtual_hardware,
            seed=setup.seed,
            motion=motion,
            board=board,
            scene=setup.scene,
            model=blob_for(_parameters(setup)) if board == _STANDALONE else None,
        )
        self._has_loop, self._alone = board == _STANDALONE, False  # alone: the board drives the motors by itself
        joints = setup.hardware.joints is not None
        self._bridge = BridgedJoints(setup.hardware) if joints else Bridge(setup.hardware, require_imu=False)
        self._stream = ImuStream()
        self._mount = setup.robot.imu_mount.rotation
        mount = quat.from_roll_pitch_yaw(*setup.robot.imu_mount.rpy)
        self._estimator = GravityEstimator(setup.estimator.estimator, mount)
        control = warm_heater(setup) if warm else HeaterControl(setup.estimator.heater)
        self._heater = control if heating else None
        self._simulator = Simulator(setup.robot, scene=setup.modelled_scene)
        # Walls and zones in the world turn with the gravity of the model: it has to be the true one.
        around = (setup.modelled_scene is not None and setup.modelled_scene.walls) or setup.zones
        self._turn = None if around else BaseTurn(self._simulator.model, setup.simulator.turn)
        self._problem = InverseController(
            setup.robot, setup.controller.inverse, setup.hardware.transmission, setup.modelled_scene, setup.zones
        )
        self._tracker = None if tracker is None else VirtualTracker(tracker, setup.robot.length, setup.seed)
        self.observer = TipObserver(setup.robot, setup.controller.tracker)
        self._load = None if load is None else LoadFinding(setup, self._simulator, load, cells, tracker is not None)
        self._target: Target | None = None
        self._weightless = False
        self._release_slack = _RELEASE_SLACK * setup.robot.length  # m
        self._cables = np.zeros(len(setup.robot.cables))  # m, displacement of the model's cables
        self._sent = self._cables
        self._arriving: collections.deque[tuple[np.ndarray, np.ndarray] | None] = collections.deque([None] * delay)
        self._rows: list[tuple] = []
        self._outgoing: list[can.Message] = []
        self._steps = 0
        self._gravity = np.zeros(3)
        self.shape: Shape | None = None
        self.command: Command | None = None
        self._bridge.configure()
        self._bridge.activate(0.0)
        self._settle()

    @property
    def time(self) -> float:
        """Virtual time, s."""
        return self._virtual.time

    @property
    def truth(self) -> Truth:
        """Ground truth of the virtual robot, for evaluation and for a person who sees the robot."""
        return self._virtual.truth

    @property
    def trace(self) -> Trace:
        """Record since the start or the last `forget`."""
        return Trace(*(np.array(column) for column in zip(*self._rows)))

    def forget(self) -> None:
        """Begin a new record."""
        self._rows.clear()

    @property
    def virtual(self) -> VirtualRobot:
        """The virtual robot, to push it and to attach loads."""
        return self._virtual

    def zero_load(self) -> None:
        """Begin to learn the errors of model and sensors: the robot carries no unknown load. The loop has a load to find."""
        assert self._load is not None
        self._load.observer.zero(self.time)

    @property
    def load(self) -> LoadEstimate:
        """The estimated load. The loop has a load to find."""
        assert self._load is not None
        return self._load.observer.estimate(self._gravity, self.time)

    def release(self) -> None:
        """Pay the cables out: the robot is without compensation. A board that has held by itself lets go of the motors."""
        if self._alone:
            self._outgoing.append(requests.act("stop"))
        self._target = None

    def hold(self, target: Target, *, weightless: bool = False) -> None:
        """Compensate and keep the target.

        weightless: the robot is bent without compensation. The model has no gravity, idle cables are released, and there is no
        pretension.
        """
        if self._target is None:
            self._problem.reset(self._cables)
            if self._has_loop:
                self._outgoing.append(requests.act("run"))
                self._alone = True
        options = self.setup.controller.inverse
        self._problem.options = dataclasses.replace(options, pretension=0.0) if weightless else options
        self._target, self._weightless = target, weightless

    def run(self, duration: float) -> None:
        """Advance by `duration` s. Raises LoopFailed where the bridge refuses a command."""
        end = self.time + duration
        while self.time < end - 1e-9:
            self._bus_step()

    def _settle(self) -> None:
        """Advance until the bridge drives and the filter has started."""
        self._waiting = True
        while self._bridge.state not in DRIVING or self.shape is None:
            self._bus_step()
            if self.time > 5.0:
                raise LoopFailed(f"the virtual robot's bridge does not start: {self._bridge.message}")
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
        if self._steps % _CONTROL_STEPS == 0 and not self._alone:
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
            if self._turn is not None:
                self._turn.add(sample.stamp, self._mount @ np.array(estimate.imu.angular_velocity))
        released = self._target is None
        gravity = np.zeros(3)
        if released or not self._weightless:
            gravity = self._gravity
            if self._turn is not None:
                gravity = gravity + self._turn.acceleration(sample.stamp)
        # The model starts at rest and relaxed, and creeps from then on.
        elapsed = None if self.shape is None else SAMPLE_PERIOD
        carried = None if self._load is None else self._load.observer.wrench(gravity, self.time)
        cables = None if released else self._cables
        self.shape = shape = self._simulator.step(gravity, cables, duration=elapsed, wrench=carried)
        if self._load is not None:
            self._load.observe(self.time, shape, carried, cables, self._virtual.truth)
        target = self._observed(shape)
        self._cables, tension = self._released(shape) if target is None else self._compensated(shape, target)
        self._sent = self._idle_released(tension) if self._weightless and not released else self._cables
        self._arriving.append((self._sent, tension))
        arrived = self._arriving.popleft()
        if arrived is not None and not self._waiting and not self._alone:
            refused = self._bridge.command(arrived[0].tolist(), arrived[1].tolist(), self.time)
            if refused:
                raise LoopFailed(f"the bridge refused a command at {self.time:.2f} s: {refused}")
        self._record(shape)

    def _observed(self, shape: Shape) -> Target | None:
        """Pass the shape and what the tracker measured to the observer; return the target for the model."""
        if self._tracker is None:
            return self._target
        now = self.time
        self.observer.predict(
            now, shape.tip_position, shape.tip_orientation, shape.response, shape.cable_tension, bool(len(shape.contacts))
        )
        for measured in self._tracker.observe(self._virtual.truth):
            self.observer.measure(measured.time, now, "soft_base", measured.position)
            if self._load is not None:
                self._load.observer.measure_tip(measured.time, measured.position)
        return None if self._target is None else self.observer.corrected(self._target, now)

    def _released(self, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        free = shape.response.displacement_free - self._release_slack
        displacement = (
            self._cables if self._waiting else within_limits(free, self._cables, self.setup.robot.limits, SAMPLE_PERIOD)
        )
        return self.setup.hardware.transmission.possible(displacement, np.zeros(len(free))), np.zeros(len(free))

    def _compensated(self, shape: Shape, target: Target) -> tuple[np.ndarray, np.ndarray]:
        if self._has_loop:
            result = self._virtual.firmware.loop()
            return result.displacement, result.tension
        command = self._problem.step(
            shape.response,
            target,
            backbone_station=shape.backbone_station,
            tension=shape.cable_tension,
            interval=SAMPLE_PERIOD,
            followed=shape.is_equilibrium,
            contact=shape.contacts.by_obstacle(),
            gravity=shape.gravity,
        )
        self.command = command
        return command.displacement, command.tension

    def _idle_released(self, tension: np.ndarray) -> np.ndarray:
        wanted = np.where(tension > _IDLE * self.setup.robot.limits.tension_max, self._cables, self._cables - self._release_slack)
        paid_out = within_limits(wanted, self._sent, self.setup.robot.limits, SAMPLE_PERIOD)
        return self.setup.hardware.transmission.possible(paid_out, tension)

    def _record(self, shape: Shape) -> None:
        truth = self._virtual.truth
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
                truth.base_position,
                truth.wall_force,
                float(truth.contact_depth.max(initial=0.0)),
            )
        )


def _parameters(setup: Setup) -> LoopParameters:
    """Return what the loop on the board takes from the setup. Raises ConfigError for what it does not know."""
    found = LoopParameters(setup.source, setup.robot, setup.estimator, setup.controller, setup.hardware, setup.simulator.turn)
    found.refuse_unknown(setup.modelled_scene, setup.zones, setup.simulator)
    return found
