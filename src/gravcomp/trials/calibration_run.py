"""A calibration run on the virtual robot: the measurement that a user makes on the real robot with a camera.

The base is at rest in several poses. In each pose the cables are released first; then the uncalibrated controller straightens
and bends the robot, so that every cable is taut in some pose. Recorded are the estimated gravity, the commanded displacements,
and the true tip position with a camera's noise.
"""

import dataclasses
from dataclasses import dataclass

import numpy as np

from gravcomp.calibration.apply import calibrated_hardware, calibrated_robot
from gravcomp.calibration.fit import StaticFit, fit_statics
from gravcomp.calibration.measured import Measured, still_windows
from gravcomp.closed_loop.loop import ClosedLoop
from gravcomp.closed_loop.setup import Setup
from gravcomp.closed_loop.trace import Trace
from gravcomp.inverse import bend_target, straight_target
from gravcomp.trials.context import Context
from gravcomp.virtual.motion import StaticMotion, base_orientation

CAMERA_NOISE = 0.1e-3  # m, standard deviation per coordinate
_DECIMATION = 5  # 20 Hz, the rate of a camera

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


def measure(context: Context) -> Measured:
    """Return the measurements of the calibration run in all poses."""
    poses = CALIBRATION_POSES[:: 3 if context.brief else 1]
    jobs = [(context.setup, pose, trial, 2.5 if context.brief else 4.0) for trial, pose in enumerate(poses)]
    return joined(context.map(calibration_trial, jobs, "measuring the virtual robot for calibration"))


def calibrate_on_virtual_robot(context: Context) -> Calibration:
    """Measure, and fit the controller's model to the measurements."""
    setup, measured = context.setup, measure(context)
    fit = fit_statics(setup.robot, still_windows(measured), progress=lambda stage: context.progress(f"calibrating: {stage}"))
    calibrated = setup.with_model(
        calibrated_robot(setup.robot, fit.parameters), calibrated_hardware(setup.hardware, fit.parameters)
    )
    return Calibration(measured, fit, calibrated)


def calibration_trial(job: tuple[Setup, tuple[float, float], int, float]) -> Measured:
    """Run one pose. job: (setup, (inclination, roll) in deg, number of the trial, duration of each state in s)."""
    setup, (inclination, roll), trial, duration = job
    # Without pretension: with all cables taut, a common offset cannot be distinguished from a change of modulus and elasticity.
    inverse = dataclasses.replace(setup.controller.inverse, pretension=0.0)
    setup = dataclasses.replace(setup, controller=dataclasses.replace(setup.controller, inverse=inverse))
    loop = ClosedLoop(setup, StaticMotion(base_orientation(np.radians(inclination), np.radians(roll))))
    loop.release()
    loop.run(duration)
    loop.hold(straight_target(setup.robot.length, tip_direction_weight=setup.direction_weight))
    loop.run(0.6 * duration)
    loop.hold(
        bend_target(
            setup.robot.length,
            np.radians(30.0),
            np.radians(60.0 * trial),
            tip_direction_weight=setup.direction_weight,
        )
    )
    loop.run(0.6 * duration)
    return as_measured(loop.trace, trial, np.random.default_rng([setup.seed, trial]))


def as_measured(trace: Trace, trial: int, random: np.random.Generator) -> Measured:
    """Return what a camera and the topics of the graph would record of the run."""
    rows = slice(0, len(trace.time), _DECIMATION)
    tip = trace.tip_position[rows]
    return Measured(
        source="virtual robot",
        trial=np.full(len(tip), trial),
        time=trace.time[rows],
        gravity=trace.estimated_gravity[rows],
        displacement=trace.command[rows],
        tip_position=tip + CAMERA_NOISE * random.standard_normal(tip.shape),
        tip_direction=trace.tip_direction[rows],
    )


def joined(trials: list[Measured]) -> Measured:
    """Concatenate trials to one measurement."""
    columns = {
        name: np.concatenate([getattr(trial, name) for trial in trials])
        for name in ("trial", "time", "gravity", "displacement", "tip_position", "tip_direction")
    }
    return Measured(source=trials[0].source, **columns)
