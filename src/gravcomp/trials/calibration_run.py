"""A calibration run on the virtual robot: the measurement that a user makes on the real robot with a camera.

The base turns from pose to pose of a plan (`calibration.plan`), and the bridge pulls the cables by the planned displacements;
model and controller take no part. The board is as warm as in use, because its accelerometer's bias changes with the temperature:
what a fit finds of the IMU holds at that temperature only. Recorded are the estimated gravity, the length of the
specific force, the commanded displacements, and the true tip with a tracker's noise (`tracker.Tracker`). The robot is weighed
on a balance.
"""

import dataclasses
from dataclasses import dataclass

import can
import numpy as np
from scipy.spatial.transform import Rotation

from gravcomp.calibration.apply import calibrated_hardware, calibrated_imu, calibrated_robot
from gravcomp.calibration.approach import approached, as_pulled
from gravcomp.calibration.data import WINDOWS
from gravcomp.calibration.fit import StaticFit, TipNoise, fit_statics
from gravcomp.calibration.measured import Measured, still_windows
from gravcomp.calibration.plan import Plan, PlanOptions, creep_times
from gravcomp.calibration.planning import make_plan
from gravcomp.calibration.pose_candidates import ORIENTATIONS
from gravcomp.calibration.standstill import Standstill
from gravcomp.canbus import codec
from gravcomp.canbus.imu_stream import IMU_FRAMES, ImuStream
from gravcomp.closed_loop.loop_failed import LoopFailed
from gravcomp.closed_loop.setup import Setup
from gravcomp.closed_loop.warm_board import warm_heater, with_warm_board
from gravcomp.description import Robot
from gravcomp.full_model.modes import first_period
from gravcomp.full_model.robot_model import RobotModel
from gravcomp.mesh.coarse import with_coarse_elements
from gravcomp.motors.bridge import Bridge
from gravcomp.motors.state import DRIVING
from gravcomp.orientation import GravityEstimator, Problem
from gravcomp.orientation import quaternion as quat
from gravcomp.trials.context import Context
from gravcomp.trials.tracker import Tracker
from gravcomp.virtual.motion import WaypointMotion, base_orientation
from gravcomp.virtual.robot import VirtualRobot

_BUS_STEP, _SAMPLE_PERIOD = 0.002, 0.010  # s
_CONTROL_STEPS = 2  # bus steps in a control period of the bridge: 250 Hz
_HEATER_STEPS = 50  # bus steps between commands of the heater: 10 Hz
_DECIMATION = 5  # samples of the IMU: 20 Hz, the rate of a slow camera
_LONGEST_START = 5.0  # s
_BRIEF, _FEWER = 0.12, 6  # of the budget; every so many of the orientations
_FEWEST = 5  # poses: the three of an orientation, the last one, and the turn
_BRIEFLY_FITTED = {"offsets", "compliance", "weight"}  # with the moduli: the others take most of the derivatives' time


@dataclass(frozen=True)
class Calibration:
    """Result of a calibration.

    measured: the run; fit: parameters fitted to its windows at rest; setup: the same virtual robot with the calibrated
    controller.
    """

    measured: Measured
    fit: StaticFit
    setup: Setup


def plan_of(context: Context, options: PlanOptions | None = None) -> Plan:
    """Return the plan for the context's robot; a brief context has a shorter one. Raises ConfigError, MeshError."""
    options, setup, orientations = options or PlanOptions(), context.setup, ORIENTATIONS
    if context.brief:
        options = dataclasses.replace(
            options,
            budget=_BRIEF * options.budget,
            fewest=max(_FEWEST, int(_BRIEF * options.fewest)),
            assured=_FEWEST,
        )
        orientations = ORIENTATIONS[::_FEWER]
    period = first_period(setup.robot)
    inverse = setup.controller.inverse
    robot = as_pulled(setup.robot, setup.hardware)
    return make_plan(robot, period, setup.hardware.transmission, options, context.progress, orientations, inverse)


def measure(context: Context, plan: Plan) -> Measured:
    """Return the measurements in all poses of the plan. Raises LoopFailed where the bridge does not start."""
    stage = f"measuring the virtual robot for calibration, {plan.duration:.0f} s of its time"
    return context.map(run_plan, [(context.setup, plan)], stage)[0]


def weighed(setup: Setup) -> float:
    """Return the mass in kg of the virtual robot's body and payload, as a balance shows it."""
    true = RobotModel(with_coarse_elements(_with_true_densities(setup))).mass
    return true * float(1.0 + TipNoise().balance * np.random.default_rng([setup.seed, 1]).standard_normal())


def calibrate_on_virtual_robot(context: Context) -> Calibration:
    """Plan, measure, and fit the controller's model to the measurements."""
    setup, plan = context.setup, plan_of(context)
    measured = measure(context, plan)
    still = Standstill.of(setup.robot, first_period(setup.robot))
    fit = fit_statics(
        setup.robot,
        still_windows(measured, still, WINDOWS),
        groups=_BRIEFLY_FITTED if context.brief else None,
        mass=weighed(setup),
        creep_times=creep_times(plan.rest),
        progress=lambda stage: context.progress(f"calibrating: {stage}"),
    )
    calibrated = setup.with_model(
        calibrated_robot(setup.robot, fit.parameters, creep_times=fit.creep_times),
        calibrated_hardware(setup.hardware, fit.parameters),
        calibrated_imu(setup.estimator.calibration, setup.robot, fit.parameters),
    )
    return Calibration(measured, fit, calibrated)


def run_plan(job: tuple[Setup, Plan]) -> Measured:
    """Run the plan on the virtual robot. A function of the module, so that it can be sent to another process."""
    setup, plan = job
    rig = _Rig(setup, WaypointMotion(*_stops(plan)))
    rig.start()
    for pose, end in zip(plan.poses, _ends(plan)):
        rig.pull(pose.displacement, pose.tension, end)
    rows = slice(0, len(rig.rows), _DECIMATION)
    time, gravity, displacement, tip, direction, force = (np.array(column)[rows] for column in zip(*rig.rows))
    tip, direction = Tracker().seen(setup.nominal.length, tip, direction, np.random.default_rng([setup.seed, 0]))
    return Measured("virtual robot", np.zeros(len(time), int), time, gravity, displacement, tip, direction, force)


def _stops(plan: Plan) -> tuple[list[tuple[np.ndarray, float]], float]:
    """Return orientation and time in s at each station of the plan, and the rate of the turns between them."""
    stops: list[tuple[np.ndarray, float]] = []
    for pose, held in zip(plan.poses, plan.times):
        orientation = base_orientation(pose.inclination, pose.roll)
        if stops and np.array_equal(stops[-1][0], orientation):
            stops[-1] = orientation, stops[-1][1] + held
        else:
            stops.append((orientation, held))
    return stops, plan.rate


def _ends(plan: Plan) -> list[float]:
    """Return the times in s at which the poses end."""
    rests = WaypointMotion(*_stops(plan)).rests
    ends: list[float] = []
    station = -1
    for k, (pose, held) in enumerate(zip(plan.poses, plan.times)):
        turned = k == 0 or pose.station != plan.poses[k - 1].station
        station += turned
        ends.append((rests[station][0] if turned else ends[-1]) + held)
    return ends


class _Rig:
    """The virtual robot, the bridge and the estimator, without model and controller. rows: one for each sample of the IMU."""

    def __init__(self, setup: Setup, motion: WaypointMotion):
        warm = with_warm_board(setup)
        self._virtual = VirtualRobot(warm, setup.nominal, setup.virtual_hardware, seed=setup.seed, motion=motion)
        self._heater = warm_heater(setup)
        self._bridge = Bridge(setup.hardware, require_imu=False)
        self._stream, self._limits = ImuStream(), as_pulled(setup.robot, setup.hardware).limits
        self._estimator = GravityEstimator(setup.estimator.estimator, quat.from_roll_pitch_yaw(*setup.robot.imu_mount.rpy))
        self._transmission = setup.hardware.transmission
        self._sent = np.zeros(len(setup.robot.cables))
        self._outgoing: list[can.Message] = []
        self._steps, self._gravity, self._force = 0, np.zeros(3), 0.0
        self.rows: list[tuple] = []

    def start(self) -> None:
        """Advance until the bridge drives. Raises LoopFailed where it does not."""
        self._bridge.configure()
        self._bridge.activate(0.0)
        while self._bridge.state not in DRIVING or not self._gravity.any():
            self._step(None, None)
            if self._virtual.time > _LONGEST_START:
                raise LoopFailed(f"the virtual robot's bridge does not start: {self._bridge.message}")

    def pull(self, displacement: np.ndarray, tension: np.ndarray, end: float) -> None:
        """Move the cables to `displacement` (m,) m within their limits and keep them there until `end` s; record."""
        while self._virtual.time < end - 1e-9:
            self._step(displacement, tension)

    def _step(self, displacement: np.ndarray | None, tension: np.ndarray | None) -> None:
        frames, self._outgoing = self._virtual.step(_BUS_STEP, self._outgoing), []
        now = self._virtual.time
        for frame in frames:
            if frame.arbitration_id not in IMU_FRAMES:
                self._bridge.on_frame(frame, now)
                continue
            sample = self._stream.on_frame(frame, now)
            if sample is None:
                continue
            stamp_ns = round(1e9 * sample.stamp)
            self._estimator.add_temperature(stamp_ns, sample.temperature)
            self._heater.update(stamp_ns, sample.temperature)
            estimate = self._estimator.update(stamp_ns, sample.angular_rate, sample.specific_force)
            if not isinstance(estimate, Problem):
                self._gravity, self._force = np.array(estimate.gravity), float(np.linalg.norm(estimate.accel))
            if displacement is not None and tension is not None:
                self._command(displacement, tension, now)
        self._steps += 1
        if self._steps % _CONTROL_STEPS == 0:
            self._outgoing += self._bridge.tick(now)
        if self._steps % _HEATER_STEPS == 0:
            sequence = self._steps // _HEATER_STEPS % 256
            self._outgoing.append(codec.encode("HeaterCommand", duty=self._heater.state.duty, sequence=sequence))

    def _command(self, displacement: np.ndarray, tension: np.ndarray, now: float) -> None:
        moved = approached(displacement, self._sent, self._limits, _SAMPLE_PERIOD)
        self._sent = self._transmission.possible(moved, tension)
        refused = self._bridge.command(self._sent.tolist(), tension.tolist(), now)
        if refused:
            raise LoopFailed(f"the bridge refused a command at {now:.2f} s: {refused}")
        truth = self._virtual.truth
        direction = Rotation.from_quat(truth.tip_orientation).apply((0.0, 0.0, 1.0))
        self.rows.append((truth.time, self._gravity, self._sent, truth.tip_position, direction, self._force))


def _with_true_densities(setup: Setup) -> Robot:
    """Return the described robot with the densities of the virtual one."""
    true = setup.true_robot.robot.materials
    return setup.nominal.with_materials(
        [dataclasses.replace(material, density=other.density) for material, other in zip(setup.nominal.materials, true)]
    )
