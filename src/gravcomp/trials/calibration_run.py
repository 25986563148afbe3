"""A calibration run on the virtual robot: the measurement that a user makes on the real robot with a camera.

The base is at rest in several poses. In each pose the cables are released first; then the uncalibrated controller straightens
and bends the robot, so that every cable is taut in some pose. Recorded are the estimated gravity, the commanded displacements,
and the true tip with a tracker's noise (`tracker.Tracker`).
"""

import dataclasses
from dataclasses import dataclass

import numpy as np

from gravcomp.calibration.apply import calibrated_hardware, calibrated_robot
from gravcomp.calibration.fit import StaticFit, fit_statics
from gravcomp.calibration.measured import Measured, still_windows
from gravcomp.calibration.standstill import Standstill
from gravcomp.closed_loop.loop import ClosedLoop
from gravcomp.closed_loop.setup import Setup
from gravcomp.closed_loop.trace import Trace
from gravcomp.config import parameter
from gravcomp.full_model.modes import first_period
from gravcomp.inverse import bend_target, straight_target
from gravcomp.mesh.tube import with_coarse_elements
from gravcomp.trials.context import Context
from gravcomp.trials.tracker import Tracker
from gravcomp.virtual.motion import StaticMotion, base_orientation

_DECIMATION = 5  # 20 Hz, the rate of a slow camera

CALIBRATION_POSES = ((0.0, 0.0), (0.0, 60.0), (0.0, 120.0), (0.0, 180.0), (0.0, 240.0), (0.0, 300.0))
"""Inclination and roll in degrees; the rolls make each cable support the robot in turn."""


@dataclass(frozen=True)
class Calibration:
    """Result of a calibration.

    measured: the run; fit: parameters fitted to its windows at rest; setup: the same virtual robot with the calibrated
    controller.
    """

    measured: Measured
    fit: StaticFit
    setup: Setup


@dataclass(frozen=True)
class Schedule:
    """Times of a calibration run: multiples of the robot's first period, within a budget of robot time."""

    budget: float = parameter(180.0, unit="s", minimum=10.0, maximum=3600.0, description="robot time of all poses together")
    periods: float = parameter(
        14.0, minimum=2.0, maximum=200.0, description="first periods that a released robot is given to come to rest"
    )
    held: float = parameter(0.6, minimum=0.1, maximum=5.0, description="time of each held state over that of the released one")
    least: float = parameter(
        0.3, minimum=0.0, maximum=1.0, description="least part of the budget that is used, because materials creep at any size"
    )

    def released(self, period: float, poses: int) -> float:
        """Return the time in s for which the robot is released in each pose; period: its first, in s."""
        share = self.budget / poses / (1.0 + 2.0 * self.held)
        return float(np.clip(self.periods * period, self.least * share, share))


def measure(context: Context, schedule: Schedule | None = None) -> Measured:
    """Return the measurements of the calibration run in all poses. Raises MeshError."""
    schedule = schedule or Schedule()
    poses = CALIBRATION_POSES[:: 3 if context.brief else 1]
    duration = schedule.released(first_period(context.setup.robot), len(CALIBRATION_POSES)) / (1.6 if context.brief else 1.0)
    jobs = [(context.setup, pose, trial, duration, schedule.held) for trial, pose in enumerate(poses)]
    total = len(poses) * duration * (1.0 + 2.0 * schedule.held)
    return joined(context.map(calibration_trial, jobs, f"measuring the virtual robot for calibration, {total:.0f} s of its time"))


def calibrate_on_virtual_robot(context: Context) -> Calibration:
    """Measure, and fit the controller's model to the measurements."""
    setup, measured = context.setup, measure(context)
    still = Standstill.of(setup.robot, first_period(setup.robot))
    fit = fit_statics(
        setup.robot, still_windows(measured, still), progress=lambda stage: context.progress(f"calibrating: {stage}")
    )
    calibrated = setup.with_model(
        calibrated_robot(setup.robot, fit.parameters), calibrated_hardware(setup.hardware, fit.parameters)
    )
    return Calibration(measured, fit, calibrated)


def calibration_trial(job: tuple[Setup, tuple[float, float], int, float, float]) -> Measured:
    """Run one pose.

    job: (setup, (inclination, roll) in deg, number of the trial, time in s released, time of each held state over that).
    """
    setup, (inclination, roll), trial, duration, held = job
    # The controller only has to bring the robot into different states: a coarse mesh does, and needs no reduced model.
    setup = setup.with_model(with_coarse_elements(setup.robot))
    # Without pretension: with all cables taut, a common offset cannot be distinguished from a change of modulus and elasticity.
    inverse = dataclasses.replace(setup.controller.inverse, pretension=0.0)
    setup = dataclasses.replace(setup, controller=dataclasses.replace(setup.controller, inverse=inverse))
    loop = ClosedLoop(setup, StaticMotion(base_orientation(np.radians(inclination), np.radians(roll))))
    loop.release()
    loop.run(duration)
    loop.hold(straight_target(setup.robot.length, tip_direction_weight=setup.direction_weight))
    loop.run(held * duration)
    loop.hold(
        bend_target(
            setup.robot.length,
            np.radians(30.0),
            np.radians(60.0 * trial),
            tip_direction_weight=setup.direction_weight,
        )
    )
    loop.run(held * duration)
    return as_measured(loop.trace, trial, setup.nominal.length, np.random.default_rng([setup.seed, trial]))


def as_measured(trace: Trace, trial: int, length: float, random: np.random.Generator) -> Measured:
    """Return what a tracker and the topics of the graph would record of the run of a robot of `length` m."""
    rows = slice(0, len(trace.time), _DECIMATION)
    tip, direction = Tracker().seen(length, trace.tip_position[rows], trace.tip_direction[rows], random)
    return Measured(
        source="virtual robot",
        trial=np.full(len(tip), trial),
        time=trace.time[rows],
        gravity=trace.estimated_gravity[rows],
        displacement=trace.command[rows],
        tip_position=tip,
        tip_direction=direction,
    )


def joined(trials: list[Measured]) -> Measured:
    """Concatenate trials to one measurement."""
    columns = {
        name: np.concatenate([getattr(trial, name) for trial in trials])
        for name in ("trial", "time", "gravity", "displacement", "tip_position", "tip_direction")
    }
    return Measured(source=trials[0].source, **columns)
