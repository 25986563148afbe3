"""`gravcomp calibrate DATA`: the robot's parameters from measured tips, of a file or of the virtual robot."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from gravcomp.commands import output
from gravcomp.commands.virtual_seed import seed_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from gravcomp.calibration.data import Data
    from gravcomp.calibration.measured import Measured
    from gravcomp.calibration.motion import MotionFit
    from gravcomp.calibration.plan import PlanOptions
    from gravcomp.calibration.standstill import Standstill
    from gravcomp.closed_loop.setup import Setup
    from gravcomp.description import Robot, RobotFile
    from gravcomp.report.result import Result
    from gravcomp.sweep import Sweep

KEPT = {
    "offsets": "the zeros of the cables", "compliance": "the cables' stretch", "winding": "the capstan radius",
    "places": "radii and angles of the cables", "weight": "density and payload", "mount": "the mount of the IMU",
    "bias": "the offset of the accelerometer", "slow-creep": "the creep", "friction": "the friction of the cables",
}  # fmt: skip
"""What is not fitted if its option is given."""


def fit_tips(args: argparse.Namespace, file: "RobotFile", target: Path) -> "Result":
    """Fit to resting tips and to motion, write the robot file `target`, and return the result.

    Raises ConfigError, and MeshError for a body that cannot be meshed.
    """
    from gravcomp.calibration.apply import calibrated_hardware, calibrated_imu, calibrated_robot, with_behaviour, write_calibrated
    from gravcomp.calibration.fit import fit_statics
    from gravcomp.calibration.measured import MeasurementError
    from gravcomp.calibration.moving import moving
    from gravcomp.calibration.report import calibration_result, origin_of
    from gravcomp.calibration.standstill import Standstill
    from gravcomp.closed_loop.setup import Setup
    from gravcomp.config import ConfigError
    from gravcomp.full_model.modes import first_period
    from gravcomp.sweep import Sweep

    setup = Setup.of(file, seed_of(args))
    if args.data == "virtual":
        output.note(setup.true_robot.summary())
    with Sweep(args.workers) as sweep, output.stages("reading") as show:
        try:
            still = Standstill.of(setup.robot, first_period(setup.robot))
            data = _data(args, setup, still, sweep, show)
            statics = fit_statics(
                setup.robot,
                data.windows,
                groups=_groups(args),
                mass=data.mass,
                creep_times=data.creep_times,
                progress=show,
            )
            robot = calibrated_robot(setup.robot, statics.parameters, creep_times=statics.creep_times)
            hardware = calibrated_hardware(setup.hardware, statics.parameters)
            imu = calibrated_imu(setup.estimator.calibration, setup.robot, statics.parameters)
            courses = [] if args.no_damping or data.measured is None else moving(data.measured, statics.parameters, still)
            motion, kept = _motion(robot, courses, args, sweep, show)
            if motion is not None and motion.damping_seen:
                robot = with_behaviour(robot, motion)
        except (MeasurementError, RuntimeError) as error:
            raise ConfigError(str(error)) from error
    write_calibrated(
        file.source,
        target,
        setup.robot,
        robot,
        hardware,
        setup.seed if args.data == "virtual" else None,
        origin_of(file.source, data.source, statics),
        None if imu == setup.estimator.calibration else imu,
    )
    result = calibration_result(data.source, str(target), statics, motion, courses, setup.robot.materials[0].damping_time)
    if data.duration is not None:
        result.data["robot_time_s"] = round(data.duration, 1)
    if kept:
        result.notes.insert(0, f"damping time: {kept}; the value of the robot file is kept")
    return result


def _motion(
    robot: "Robot", courses: "list[Measured]", args: argparse.Namespace, sweep: "Sweep", show: "Callable[[str], None]"
) -> "tuple[MotionFit | None, str]":
    """Return the fit of the robot's motion to the courses, or None and why its damping is kept; what was found at rest counts."""
    from gravcomp.calibration.motion import fit_motion
    from gravcomp.mesh.coarse import with_coarse_elements

    if not courses:
        return None, "" if args.no_damping else "no trial contains fast motion"
    try:
        motion = fit_motion(
            with_coarse_elements(robot),
            courses,
            modulus=False,
            creep=args.creep,
            mapper=sweep.map,
            progress=lambda s: show(f"damping: {s}"),
        )
    except RuntimeError as error:
        return None, str(error)
    if motion.rms_before is not None and motion.rms_after > motion.rms_before:
        before, after = 1e3 * motion.rms_before, 1e3 * motion.rms_after
        return None, f"the fit to the motion is worse: {before:.2f} mm before, {after:.2f} mm after"
    return motion, ""


def _data(args: argparse.Namespace, setup: "Setup", still: "Standstill", sweep: "Sweep", show: "Callable[[str], None]") -> "Data":
    """Return what was measured: from the given file, or of the virtual robot. Raises MeasurementError, RuntimeError."""
    from gravcomp.calibration.data import Data, read_data
    from gravcomp.calibration.plan import creep_times

    mass = None if args.mass_g is None else 1e-3 * args.mass_g
    if args.data != "virtual":
        return read_data(args.data, setup.robot, still, mass, args.tip_topic)
    from gravcomp.trials.calibration_run import measure, plan_of, weighed
    from gravcomp.trials.context import Context

    context = Context(setup, sweep, show)
    plan = plan_of(context, plan_options(args))
    if plan.note:
        output.note(plan.note)
    measured = measure(context, plan)
    return Data.of(measured, still, weighed(setup) if mass is None else mass, creep_times(plan.rest), plan.duration)


def _groups(args: argparse.Namespace) -> set[str]:
    """Return what is fitted in addition to the moduli."""
    return {name.replace("slow-creep", "creep") for name in KEPT if not getattr(args, f"no_{name.replace('-', '_')}")}


def plan_options(args: argparse.Namespace) -> "PlanOptions":
    """Return the options of the plan."""
    from gravcomp.calibration.plan import PlanOptions

    return PlanOptions() if args.time is None else PlanOptions(budget=args.time)
