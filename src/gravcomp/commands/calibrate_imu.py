"""`gravcomp calibrate-imu FILE`: what a recording of the resting IMU tells of it, written into the robot's YAML and a bias model."""

import argparse
import json
import math
from pathlib import Path

import numpy as np

from gravcomp.config import ConfigError, from_mapping


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.description = (
        "Record imu/data_raw and imu/temperature while the IMU lies still in several poses, each for 5 s: at best with every axis once up and once"
        " down. From that: scale and offset of the accelerometer, offset of the gyroscope; with --up the IMU's mount; with --bias-model the"
        " gyroscope's bias over temperature, learned while the chip warms."
    )
    parser.add_argument(
        "file", metavar="FILE", help="a rosbag2 folder, or an .npz file in BROAD's layout (gyr rad/s, acc m/s^2, rate Hz)"
    )
    parser.add_argument("--topic", help="the IMU topic, for a bag with several")
    parser.add_argument("--robot", default="article", help="robot file or shipped robot to start from (default: article)")
    parser.add_argument(
        "--up", nargs=3, type=float, action="append", metavar=("X", "Y", "Z"),
        help="direction in soft_base that pointed up in a pose; once for each pose, in their order: fits the mount",
    )  # fmt: skip
    parser.add_argument(
        "--bias-model", metavar="FILE", help="write the bias over temperature there; needs imu/temperature in the bag"
    )
    parser.add_argument("--write", metavar="YAML", help="where the calibrated robot goes (default: NAME-calibrated.yaml here)")
    parser.add_argument("--json", action="store_true", help="print the result as JSON, last line of the output")


def run(args: argparse.Namespace) -> int:
    """Run the command; 0: written. Raises ConfigError."""
    from gravcomp.calibration.apply import write_imu_calibration
    from gravcomp.description import load_robot_file
    from gravcomp.graph.parameters.imu_estimator import ImuEstimatorParameters
    from gravcomp.orientation.calibration import CalibrationError, calibrate
    from gravcomp.recordings.imu import RecordingError, read_recording

    file = load_robot_file(args.robot)
    section = file.section("nodes").get("imu_estimator")
    options = from_mapping(ImuEstimatorParameters, section, source=file.source, key="nodes.imu_estimator").estimator
    for direction in args.up or ():
        if not np.isfinite(direction).all() or np.linalg.norm(direction) < 1e-6:
            raise ConfigError(f"--up is {direction}; a direction other than zero is needed")
    try:
        recording = read_recording(args.file, args.topic)
        found = calibrate(recording, options.filter, np.array(args.up) if args.up else None)
    except (RecordingError, CalibrationError) as error:
        raise ConfigError(str(error)) from error
    span = _learn_bias(recording, options, found, Path(args.bias_model)) if args.bias_model else None
    target = Path(args.write or f"{file.robot.name}-calibrated.yaml").expanduser()
    write_imu_calibration(file.source, target, found, Path(args.bias_model).expanduser() if args.bias_model else None)
    figures = _figures(args, found, span, target)
    _tell(figures)
    if args.json:
        print(json.dumps(figures))
    return 0


def _learn_bias(recording, options, found, path: Path) -> tuple[float, float]:
    """Write the bias over temperature beyond the offset found; returns the temperatures (degC) that it covers."""
    from dataclasses import replace

    from gravcomp.orientation import GravityEstimator, estimate_recording

    if recording.temperature is None:
        raise ConfigError(f"{recording.source}: holds no imu/temperature; without it no bias over temperature can be learned")
    estimator = GravityEstimator(replace(options, calibration=found.correction))
    estimate_recording(recording, estimator)
    if estimator.learned.span is None:
        raise ConfigError(
            f"{recording.source}: the IMU did not rest while its temperature was told; no bias over temperature was learned"
        )
    try:
        # Written anew: what an older model holds is relative to the older offset.
        estimator.learned.save(path)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be written: {error.strerror}") from error
    return estimator.learned.span


def _figures(args: argparse.Namespace, found, span: tuple[float, float] | None, target: Path) -> dict:
    fit, correction = found.accelerometer, found.correction
    notes = [
        f"the poses hardly show the accelerometer's {axis} axis; let it point up once and down once"
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


def _tell(figures: dict) -> None:
    from rich.console import Console

    console = Console(stderr=True, highlight=False)

    def row(name: str, values: list, unit: str, stds: list | None = None) -> None:
        numbers = "  ".join(f"{v:+.4f}" + (f" ±{s:.4f}" if stds else "") for v, s in zip(values, stds or values))
        console.print(f"  {name:<22}{numbers} {unit}")

    console.print(f"{figures['file']}: {len(figures['poses'])} resting pose(s)")
    row("accelerometer scale", figures["accel_scale"], "", figures["accel_scale_std"])
    row("accelerometer offset", figures["accel_offset_m_s2"], "m/s^2", figures["accel_offset_std_m_s2"])
    row("gyroscope offset", figures["gyro_offset_deg_s"], "deg/s")
    console.print(
        f"  | |a| - g | at rest    {figures['norm_error_before_m_s2']:.4f} before, {figures['norm_error_after_m_s2']:.4f} m/s^2 after, RMS"
    )
    if figures["mount_rpy_deg"] is not None:
        row("mount roll pitch yaw", figures["mount_rpy_deg"], "deg")
    if figures["bias_model"] is not None:
        model = figures["bias_model"]
        console.print(
            f"  bias model            {model['from_degc']:.1f} to {model['to_degc']:.1f} degC: [bold]{model['file']}[/bold]"
        )
    for note in figures["notes"]:
        console.print(f"[yellow]-[/yellow] {note}")
    console.print(f"written: [bold]{figures['written']}[/bold]")
