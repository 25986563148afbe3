"""`gravcomp estimate FILE`: run the orientation filter offline over a recording; the result is that of the node imu_estimator."""

import argparse
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gravcomp.commands import output
from gravcomp.commands.folders import checked_target
from gravcomp.commands.imu_topic import add_imu_topic, imu_topic

if TYPE_CHECKING:
    from gravcomp.orientation import EstimatedRecording, EstimatorOptions


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument(
        "file",
        metavar="FILE",
        help="a rosbag2 folder, an .npz file in BROAD's layout (gyr rad/s, acc m/s^2, rate Hz; quat, movement), or CSV",
    )
    parser.add_argument(
        "--out", metavar="FILE.npz", help="write stamp, quat (w x y z, sensor to earth), gravity, bias, rest, inclination_std"
    )
    add_imu_topic(parser)
    parser.add_argument("--columns", metavar="YAML", help="names of the columns of a CSV file that do not say what they are")
    parser.add_argument(
        "--units",
        choices=("si", "auto"),
        default="si",
        help="si: rad/s, m/s^2 and right-handed axes, anything else is refused or reported; auto: convert what is found",
    )
    parser.add_argument(
        "--calibrate",
        action="store_true",
        help="fit scale and offset of the accelerometer to the recording; one that turns too little: its length at rest",
    )
    parser.add_argument("--average", type=int, default=1, metavar="N", help="average every N samples (3: 95.2 Hz in BROAD)")
    parser.add_argument(
        "--robot", default="article", help="shipped robot or robot file with the IMU's mount and the parameters of imu_estimator"
    )
    parser.add_argument("--bias-model", metavar="FILE", help="bias over temperature as written by imu_estimator")


def run(args: argparse.Namespace) -> int:
    """Estimate. Returns 0: done, 2: the recording or an option cannot be used. Raises ConfigError."""
    import numpy as np

    from gravcomp.config import ConfigError
    from gravcomp.orientation import BiasModelError, BiasTemperatureModel, GravityEstimator, estimate_recording
    from gravcomp.orientation.calibration_in_motion import calibrated
    from gravcomp.orientation.inclination import inclination_rmse
    from gravcomp.orientation.offline import without_rate_spikes
    from gravcomp.orientation.self_calibration import calibrate_from_itself
    from gravcomp.recordings.imu import read_mapping, read_recording
    from gravcomp.stream_checks import in_si

    if args.average < 1:
        raise ConfigError(f"--average is {args.average}; 1 or more is needed")
    if args.out:
        checked_target("--out", Path(args.out))
    try:
        columns = read_mapping(args.columns) if args.columns else None
        with output.progress(f"reading {args.file}") as reading:
            recording = read_recording(args.file, imu_topic(args), columns, reading)
        recording, findings, unknown = in_si(recording, convert=args.units == "auto", option="--units auto")
        options, mount = _of_robot(args.robot)
        correction = None
        if args.calibrate:
            correction, left_open = calibrate_from_itself(recording, options.filter)
            recording = calibrated(recording, correction)
            unknown += [left_open] if left_open else []
        if args.average > 1:
            recording = without_rate_spikes(recording, options.filter.spikes).averaged(args.average)
        model = BiasTemperatureModel.load(args.bias_model) if args.bias_model else None
        estimator = GravityEstimator(options, mount, model)
    except (BiasModelError, ValueError) as error:
        raise ConfigError(str(error)) from error

    with output.progress("estimating") as progress:
        begin = time.perf_counter()
        result = estimate_recording(recording, estimator, progress)
        elapsed = time.perf_counter() - begin

    figures = {
        "file": str(args.file),
        "samples": len(recording),
        "duration_s": recording.duration,
        "rate_hz": recording.rate,
        "rest_fraction": float(result.rest.mean()),
        "bias_deg_s": np.degrees(result.bias[-1]).tolist(),
        "inclination_std_deg": float(np.degrees(np.nanmean(result.inclination_std))),
        "inclination_rmse_deg": None,
        "rejected": estimator.filter.rejected,
        "problems": dict.fromkeys((*recording.notes, *(f.text for f in findings)), 1) | result.problems,
        "findings": [finding.kind for finding in findings],
        "not_shown": unknown,
        "calibration": None if correction is None else {"scale": correction.accel_scale, "offset": correction.accel_offset},
        "us_per_sample": elapsed / len(recording) * 1e6,
    }
    if recording.orientation is not None:
        rmse = inclination_rmse(result.orientation, recording.orientation, recording.movement)
        figures["inclination_rmse_deg"] = None if np.isnan(rmse) else float(np.degrees(rmse))
    if args.out:
        _write(Path(args.out), result)
        figures["out"] = str(args.out)
    output.result(figures, _text(figures))
    return 0


def _of_robot(robot: str) -> "tuple[EstimatorOptions, tuple]":
    """Return the estimator's options and the IMU's mount (quaternion w x y z) of a robot file. Raises ConfigError."""
    from gravcomp.config import from_mapping
    from gravcomp.description import load_robot_file
    from gravcomp.graph.parameters.imu_estimator import ImuEstimatorParameters
    from gravcomp.orientation import quaternion as quat

    file = load_robot_file(robot)
    section = file.section("nodes").get("imu_estimator")
    parameters = from_mapping(ImuEstimatorParameters, section, source=file.source, key="nodes.imu_estimator")
    return parameters.estimator, quat.from_roll_pitch_yaw(*file.robot.imu_mount.rpy)


def _write(path: Path, result: "EstimatedRecording") -> None:
    import numpy as np

    with path.open("wb") as file:
        np.savez_compressed(
            file,
            stamp_ns=result.stamp_ns,
            quat=result.orientation,
            gravity=result.gravity,
            bias=result.bias,
            rest=result.rest,
            inclination_std=result.inclination_std,
        )


def _text(figures: dict[str, Any]) -> str:
    lines = [
        f"{figures['file']}: {figures['samples']} samples, {figures['duration_s']:.1f} s at {figures['rate_hz']:.1f} Hz",
        f"  at rest             {100 * figures['rest_fraction']:.0f} % of the time",
        "  gyroscope bias      {:+.3f} {:+.3f} {:+.3f} deg/s at the end".format(*figures["bias_deg_s"]),
        f"  expected error      {figures['inclination_std_deg']:.2f} deg of inclination, mean standard deviation",
    ]
    if figures["inclination_rmse_deg"] is not None:
        lines.append(f"  inclination RMSE    {figures['inclination_rmse_deg']:.3f} deg against the recording's ground truth")
    lines.append(f"  rejected samples    {figures['rejected']}")
    lines += [f"    {count} x {problem}" for problem, count in figures["problems"].items()]
    lines += [f"  not checked         {sentence}" for sentence in figures["not_shown"]]
    lines.append(f"  computing time      {figures['us_per_sample']:.0f} us per sample")
    if "out" in figures:
        lines.append(f"  written             {figures['out']}")
    return "\n".join(lines)
