"""`gravcomp calibrate-imu FILE`: calibrate the IMU from a recording at rest; write a robot file and a bias model."""

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gravcomp.commands import output
from gravcomp.commands.folders import checked_target, made_folder
from gravcomp.commands.imu_topic import add_imu_topic, imu_topic

if TYPE_CHECKING:
    from gravcomp.orientation import EstimatorOptions
    from gravcomp.orientation.calibration import RestCalibration
    from gravcomp.recordings.imu import Recording


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.description = (
        "Calibrate the IMU. Record imu/data_raw and imu/temperature while the IMU is at rest in several poses, each for 5 s,"
        " ideally with every axis once up and once down. Fitted are scale and offset of the accelerometer and the offset of"
        " the gyroscope; with --up also the mount of the IMU, with --bias-model also the gyroscope's bias over"
        " temperature while the chip warms up."
    )
    parser.add_argument(
        "file",
        metavar="FILE",
        help="a rosbag2 folder, an .npz file in BROAD's layout (gyr rad/s, acc m/s^2, rate Hz), a CSV file or folder",
    )
    add_imu_topic(parser)
    parser.add_argument("--columns", metavar="YAML", help="names of the columns of a CSV file that do not say what they are")
    parser.add_argument("--robot", default="article", help="robot file or shipped robot to start from (default: article)")
    parser.add_argument(
        "--up", nargs=3, type=float, action="append", metavar=("X", "Y", "Z"),
        help="direction in soft_base that pointed up in a pose; give it once per pose, in order: fits the mount",
    )  # fmt: skip
    parser.add_argument(
        "--bias-model", metavar="FILE", help="file to write the bias over temperature to; needs imu/temperature in the bag"
    )
    parser.add_argument("--write", metavar="YAML", help="calibrated robot file to write (default: NAME-calibrated.yaml)")


def run(args: argparse.Namespace) -> int:
    """Calibrate and write. Returns 0: the robot file is written. Raises ConfigError."""
    import numpy as np

    from gravcomp.calibration.apply import write_imu_calibration
    from gravcomp.config import ConfigError, from_mapping
    from gravcomp.description import load_robot_file
    from gravcomp.graph.parameters.imu_estimator import ImuEstimatorParameters
    from gravcomp.orientation.calibration import calibrate
    from gravcomp.orientation.known_directions import show_sign
    from gravcomp.recordings.imu import read_mapping, read_recording
    from gravcomp.stream_checks import in_si

    file = load_robot_file(args.robot)
    section = file.section("nodes").get("imu_estimator")
    options = from_mapping(ImuEstimatorParameters, section, source=file.source, key="nodes.imu_estimator").estimator
    for direction in args.up or ():
        if not np.isfinite(direction).all() or np.linalg.norm(direction) < 1e-6:
            raise ConfigError(f"--up is {direction}; a direction other than zero is needed")
    target = checked_target("--write", Path(args.write or f"{file.robot.name}-calibrated.yaml").expanduser())
    bias_model = Path(args.bias_model).expanduser() if args.bias_model else None
    if bias_model is not None:
        checked_target("--bias-model", made_folder("--bias-model", bias_model.parent) / bias_model.name)
    columns = read_mapping(args.columns) if args.columns else None
    with output.progress(f"reading {args.file}") as progress:
        recording = read_recording(args.file, imu_topic(args), columns, progress)
    recording, findings, unknown = in_si(recording, convert=False)
    up = np.array(args.up) if args.up else None
    found = calibrate(recording, options.filter, up)
    if up is None or not show_sign(up / np.linalg.norm(up, axis=1, keepdims=True)):
        unknown.append("whether the accelerometer is negated shows only with --up in three poses that are not in one plane")
    span = _learn_bias(recording, options, found, bias_model) if bias_model is not None else None
    write_imu_calibration(file.source, target, found, bias_model)
    # What it is said to be calibrated for is no news here.
    odd = [finding for finding in findings if finding.kind != "accel_calibration"]
    figures = _figures(args, found, span, target) | {
        "problems": [*recording.notes, *(finding.text for finding in odd)],
        "findings": [finding.kind for finding in odd],
        "not_shown": unknown,
    }
    output.result(figures, _text(figures))
    return 0


def _learn_bias(recording: "Recording", options: "EstimatorOptions", found: "RestCalibration", path: Path) -> tuple[float, float]:
    """Learn and write the bias over temperature, relative to the fitted offset. Returns the lowest and highest temperature, degC.

    Raises ConfigError when the recording has no temperature, and when the IMU is not at rest.
    """
    from dataclasses import replace

    from gravcomp.config import ConfigError
    from gravcomp.orientation import GravityEstimator, estimate_recording

    if recording.temperature is None:
        raise ConfigError(f"{recording.source}: contains no imu/temperature, which is needed to learn the bias over temperature")
    estimator = GravityEstimator(replace(options, calibration=found.correction))
    estimate_recording(recording, estimator)
    if estimator.learned.span is None:
        raise ConfigError(
            f"{recording.source}: the IMU was never at rest while its temperature was recorded; no bias model was learned"
        )
    # An existing file is replaced: its biases are relative to the previous offset.
    estimator.learned.save(path)
    return estimator.learned.span


def _figures(
    args: argparse.Namespace, found: "RestCalibration", span: tuple[float, float] | None, target: Path
) -> dict[str, Any]:
    import numpy as np

    fit, correction = found.accelerometer, found.correction
    notes = [
        f"the poses hardly excite the accelerometer's {axis} axis; add a pose with this axis up and one with it down"
        for axis, known in zip("xyz", found.known_axes)
        if not known
    ]
    return {
        "file": str(args.file),
        "poses": [
            {
                "samples": pose.count,
                "accel_m_s2": np.round(pose.accel, 4).tolist(),
                "gyro_deg_s": np.round(np.degrees(pose.gyro), 4).tolist(),
            }
            for pose in found.poses
        ],
        "accel_scale": list(correction.accel_scale),
        "accel_scale_std": fit.scale_std.tolist(),
        "accel_offset_m_s2": list(correction.accel_offset),
        "accel_offset_std_m_s2": fit.offset_std.tolist(),
        "gyro_offset_deg_s": np.degrees(correction.gyro_offset).tolist(),
        "norm_error_before_m_s2": fit.residual_before,
        "norm_error_after_m_s2": fit.residual_after,
        "mount_rpy_deg": None if found.mount is None else [math.degrees(angle) for angle in found.mount],
        "bias_model": None if span is None else {"file": str(args.bias_model), "from_degc": span[0], "to_degc": span[1]},
        "notes": notes,
        "written": str(target),
    }


def _text(figures: dict[str, Any]) -> str:
    def row(name: str, values: list, unit: str, stds: list | None = None) -> str:
        numbers = "  ".join(f"{v:+.4f}" + (f" ±{s:.4f}" if stds else "") for v, s in zip(values, stds or values))
        return f"  {name:<22}{numbers} {unit}"

    before, after = figures["norm_error_before_m_s2"], figures["norm_error_after_m_s2"]
    lines = [
        f"{figures['file']}: {len(figures['poses'])} resting pose(s)",
        row("accelerometer scale", figures["accel_scale"], "", figures["accel_scale_std"]),
        row("accelerometer offset", figures["accel_offset_m_s2"], "m/s^2", figures["accel_offset_std_m_s2"]),
        row("gyroscope offset", figures["gyro_offset_deg_s"], "deg/s"),
        f"  | |a| - g | at rest   {before:.4f} before, {after:.4f} m/s^2 after, RMS",
    ]
    if figures["mount_rpy_deg"] is not None:
        lines.append(row("mount roll pitch yaw", figures["mount_rpy_deg"], "deg"))
    if figures["bias_model"] is not None:
        model = figures["bias_model"]
        lines.append(f"  bias model            {model['from_degc']:.1f} to {model['to_degc']:.1f} degC: {model['file']}")
    lines += [f"- {note}" for note in (*figures["notes"], *figures["problems"])]
    lines += [f"- not checked: {sentence}" for sentence in figures["not_shown"]]
    lines.append(f"written: {figures['written']}")
    return "\n".join(lines)
