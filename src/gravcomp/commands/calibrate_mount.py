"""`gravcomp calibrate-mount BAG`: the mount of the IMU from the poses of the arm that carries it; writes a robot file."""

import argparse
import math
from pathlib import Path
from typing import Any

from gravcomp.commands import output
from gravcomp.commands.folders import checked_target
from gravcomp.commands.imu_topic import add_imu_topic, imu_topic


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.description = (
        "Fit the mount of the IMU (robot.imu_mount) to a bag with imu/data_raw and joint_states: move the arm to five or more"
        " poses with the flange in different directions, and rest for 5 s in each."
    )
    parser.add_argument("bag", metavar="BAG", help="a rosbag2 folder with imu/data_raw and joint_states of the arm")
    parser.add_argument("--urdf", metavar="FILE", help="URDF of arm and robot (default: robot_description in the bag)")
    add_imu_topic(parser)
    parser.add_argument("--world-frame", default="world", help="link that carries the arm, z up (default: world)")
    parser.add_argument("--base-frame", default="soft_base", help="link of the robot's base (default: soft_base)")
    parser.add_argument("--tilt", action="store_true", help="fit also how far the arm's world is from the vertical")
    parser.add_argument("--robot", default="article", help="robot file or shipped robot to start from (default: article)")
    parser.add_argument("--write", metavar="YAML", help="robot file to write (default: NAME-mounted.yaml)")


def run(args: argparse.Namespace) -> int:
    """Fit and write. Returns 0: the robot file is written. Raises ConfigError."""
    import numpy as np

    from gravcomp.arm.chain import Chain
    from gravcomp.arm.description import read_urdf
    from gravcomp.arm.mount import fit_mount
    from gravcomp.calibration.apply import write_mount
    from gravcomp.config import ConfigError, from_mapping
    from gravcomp.description import load_robot_file
    from gravcomp.graph.parameters.imu_estimator import ImuEstimatorParameters
    from gravcomp.orientation.calibration import fit_accelerometer
    from gravcomp.orientation.resting_poses import resting_poses
    from gravcomp.recordings.bags.joint_states import read_description, read_joint_positions
    from gravcomp.recordings.imu import read_recording
    from gravcomp.stream_checks import in_si

    file = load_robot_file(args.robot)
    section = file.section("nodes").get("imu_estimator")
    options = from_mapping(ImuEstimatorParameters, section, source=file.source, key="nodes.imu_estimator").estimator
    target = checked_target("--write", Path(args.write or f"{file.robot.name}-mounted.yaml").expanduser())
    with output.progress(f"reading {args.bag}") as progress:
        recording, _, _ = in_si(read_recording(args.bag, imu_topic(args), progress=progress), convert=False)
    for note in recording.notes:
        output.note(f"{args.bag}: {note}")
    urdf = read_urdf(args.urdf) if args.urdf else read_description(args.bag)
    if urdf is None:
        raise ConfigError(f"{args.bag}: has no robot_description; give the URDF with --urdf")
    chain = Chain(urdf, args.base_frame, args.world_frame, args.urdf or "robot_description")
    stamps, positions = read_joint_positions(args.bag, chain.moving)
    joints = np.column_stack([np.interp(recording.stamp_ns, stamps, column) for column in positions.T])
    poses = resting_poses(recording, options.filter, alongside=joints)
    fit = fit_accelerometer(poses, options.filter.gravity)
    accel = np.array([fit.scale * (pose.accel - fit.offset) for pose in poses])
    base = np.array([chain.pose(dict(zip(chain.moving, pose.alongside)))[:3, :3] for pose in poses])
    found = fit_mount(accel, base, with_tilt=args.tilt)
    write_mount(file.source, target, (found.roll, found.pitch, found.yaw))
    change = found.rotation.as_matrix() @ file.robot.imu_mount.rotation.T
    degrees = [round(math.degrees(angle), 3) for angle in (found.roll, found.pitch, found.yaw)]
    figures: dict[str, Any] = {
        "poses": len(poses),
        "rpy_deg": degrees,
        "interval_deg": np.round(np.degrees(found.interval), 3).tolist(),
        "change_deg": round(math.degrees(math.acos(min(1.0, max(-1.0, 0.5 * (float(np.trace(change)) - 1.0))))), 3),
        "residual_deg": np.round(np.degrees(found.residual), 3).tolist(),
        "tilt_deg": None if found.tilt is None else np.round(np.degrees(found.tilt), 3).tolist(),
        "tilt_interval_deg": None if found.tilt_interval is None else np.round(np.degrees(found.tilt_interval), 3).tolist(),
        "file": str(target),
    }
    output.result(figures, _text(figures))
    return 0


def _text(figures: dict[str, Any]) -> str:
    roll, pitch, yaw = figures["rpy_deg"]
    x, y, z = figures["interval_deg"]
    lines = [
        f"{figures['poses']} poses at rest",
        f"mount: roll {roll:g}, pitch {pitch:g}, yaw {yaw:g} deg; about x, y, z of soft_base to {x:g}, {y:g}, {z:g} deg (95 %)",
        f"changed by {figures['change_deg']:g} deg; largest residual {max(figures['residual_deg']):g} deg",
    ]
    if figures["tilt_deg"] is not None:
        (a, b), (c, d) = figures["tilt_deg"], figures["tilt_interval_deg"]
        lines.append(f"the arm's world is tilted by {a:g} +- {c:g} deg about x and {b:g} +- {d:g} deg about y")
    return "\n".join([*lines, f"written: {figures['file']}"])
