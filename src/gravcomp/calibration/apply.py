"""Calibrated values in the descriptions of robot and motors, and in the robot file, whose comments are kept."""

import dataclasses
import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gravcomp.calibration.motion import MotionFit
from gravcomp.calibration.pose_prediction import with_moved_cables
from gravcomp.calibration.poses import PoseParameters
from gravcomp.calibration.statics import StaticParameters, with_moduli
from gravcomp.config import ConfigError
from gravcomp.description import Cable, Robot
from gravcomp.description.hardware import Hardware
from gravcomp.orientation.calibration import RestCalibration

if TYPE_CHECKING:
    from ruamel.yaml import YAML

_STIFFEST = 1e6  # N: a stiffer cable is described as inextensible


def calibrated_robot(robot: Robot, parameters: StaticParameters, damping_time: float | None = None) -> Robot:
    """Return the robot with the fitted moduli, cable elasticity and, if given, damping time in s."""
    cables = tuple(
        cable.with_stiffness(_stiffness(robot, cable, float(compliance)))
        for cable, compliance in zip(robot.cables, parameters.compliance)
    )
    if damping_time is not None:
        robot = robot.with_material(damping_time=damping_time)
    moduli = np.broadcast_to(parameters.youngs_modulus, len(robot.materials))
    return dataclasses.replace(with_moduli(robot, moduli), cables=cables)


def with_behaviour(robot: Robot, motion: MotionFit) -> Robot:
    """Return the robot with the damping time and the creep that were fitted to its motion."""
    found = motion.robot.materials[0]
    return robot.with_material(damping_time=found.damping_time, creep_ratio=found.creep_ratio, creep_time=found.creep_time)


def calibrated_hardware(hardware: Hardware, parameters: StaticParameters) -> Hardware:
    """Return the motors with the fitted capstan radius and cable offsets, relative to those of `hardware`."""
    # Of cables that share a motor it takes the offset that comes nearest to theirs.
    offsets = np.linalg.pinv(hardware.transmission.matrix) @ parameters.offset
    motors = tuple(
        dataclasses.replace(motor, offset=float(parameters.winding * motor.offset + offset))
        for motor, offset in zip(hardware.motors, offsets)
    )
    drive = dataclasses.replace(hardware.drive, capstan_radius=hardware.drive.capstan_radius * float(parameters.winding))
    return dataclasses.replace(hardware, motors=motors, drive=drive)


def robot_of_poses(robot: Robot, parameters: PoseParameters) -> Robot:
    """Return the robot with the modulus and the places of the cables that were fitted to poses."""
    return with_moved_cables(robot.with_material(youngs_modulus=parameters.youngs_modulus), parameters)


def write_calibrated(
    source: str | Path,
    target: str | Path,
    robot: Robot,
    hardware: Hardware | None,
    virtual_seed: int | None = None,
    about: str = "",
) -> None:
    """Write the robot's file `source` to `target` with the calibrated values of `robot` and, if given, `hardware`.

    virtual_seed: of the virtual robot that was measured; the new file names `source` as its description, because a virtual robot
    drawn around the calibrated values would be another one. about: where the values are from, as a comment at the top. Comments
    and order are kept. Raises ConfigError if it cannot be written, and for a target that is the source.
    """
    if Path(target).exists() and Path(target).samefile(source):
        raise ConfigError(f"{target}: is the robot file that was calibrated, and is not overwritten; give --write another name")
    document = _document(source)
    entries = document["robot"]["segments"] if robot.body is None else [document["robot"]["body"]]
    shared: set[int] = set()
    for entry, calibrated in zip(entries, robot.materials):
        material = entry.setdefault("material", {})
        if id(material) in shared:  # by a YAML alias: each segment gets values of its own
            material = entry["material"] = type(material)(material)
        shared.add(id(material))
        material["youngs_modulus_mpa"] = round(calibrated.youngs_modulus * 1e-6, 5)
        material["damping_time_ms"] = round(calibrated.damping_time * 1e3, 3)
        if calibrated.creep_ratio:
            material["creep_ratio"] = round(calibrated.creep_ratio, 5)
            material["creep_time"] = round(calibrated.creep_time, 4)
    if robot.body is not None and Path(target).resolve().parent != Path(source).resolve().parent:
        entries[0]["file"] = robot.body.file  # relative to the source, another folder than the target's
    for entry, cable in zip(document["robot"].get("cables", []), robot.cables):
        if cable.axial_stiffness is not None:
            for described in ("material", "diameter_mm"):
                entry.pop(described, None)
            entry["axial_stiffness"] = round(cable.axial_stiffness, 2)
        if cable.angle is not None and abs(math.degrees(cable.angle) - entry["angle_deg"]) > 1e-6:
            entry["angle_deg"] = round(math.degrees(cable.angle), 3)
        if cable.tip_radius is not None:
            entry["tip_radius_mm"] = round(1e3 * cable.tip_radius, 4)
    motors = document.get("hardware") or {} if hardware is not None else {}
    if hardware is not None and motors:
        for entry, motor in zip(motors.get("motors", []), hardware.motors):
            entry["offset_mm"] = round(motor.offset * 1e3, 4)
        motors.setdefault("drive", {})["capstan_radius_mm"] = round(hardware.drive.capstan_radius * 1e3, 5)
    if virtual_seed is not None:
        former = document.get("virtual_robot") or {}
        origin = former.get("description") or str(Path(source).resolve())
        document["virtual_robot"] = {"description": origin, "seed": virtual_seed}
    _write(document, target, about)


def write_imu_calibration(source: str | Path, target: str | Path, found: RestCalibration, bias_model: Path | None = None) -> None:
    """Write the robot's file `source` to `target` with the IMU's calibration, the mount if fitted, and the bias model's path.

    Comments and order are kept. Raises ConfigError if it cannot be written.
    """
    document = _document(source)
    estimator = _section(_section(document, "nodes"), "imu_estimator")
    calibration, correction = _section(estimator, "calibration"), found.correction
    calibration["accel_scale"] = [round(value, 6) for value in correction.accel_scale]
    calibration["accel_offset"] = [round(value, 5) for value in correction.accel_offset]
    calibration["gyro_offset_deg_s"] = [round(math.degrees(value), 5) for value in correction.gyro_offset]
    if bias_model is not None:
        estimator["bias_model_file"] = str(bias_model.resolve())
    if found.mount is not None:
        _section(document["robot"], "imu_mount")["rpy_deg"] = [round(math.degrees(angle), 4) for angle in found.mount]
    _write(document, target)


def write_mount(source: str | Path, target: str | Path, rpy: tuple[float, float, float]) -> None:
    """Write the robot's file `source` to `target` with the mount of the IMU: roll, pitch, yaw in rad. Raises ConfigError."""
    document = _document(source)
    _section(document["robot"], "imu_mount")["rpy_deg"] = [round(math.degrees(angle), 4) for angle in rpy]
    _write(document, target)


def _section(mapping: dict, key: str) -> dict:
    """Return the mapping under the key; create it if it is missing or empty."""
    if mapping.get(key) is None:
        mapping[key] = {}
    return mapping[key]


def _document(source: str | Path) -> dict:
    """Return the parsed YAML with its comments."""
    return _yaml().load(Path(source).read_text(encoding="utf-8"))


def _write(document: dict, target: str | Path, about: str = "") -> None:
    """Write a parsed YAML, with `about` as a comment at its top. Raises ConfigError."""
    try:
        with Path(target).open("w", encoding="utf-8") as file:
            file.writelines(f"# {line}".rstrip() + "\n" for line in about.splitlines())
            _yaml().dump(document, file)
    except OSError as error:
        raise ConfigError(f"{target}: cannot be written: {error.strerror}") from error


def _yaml() -> "YAML":
    """Return a reader and writer that keeps comments."""
    from ruamel.yaml import YAML

    yaml = YAML()
    yaml.preserve_quotes, yaml.width = True, 130
    return yaml


def _stiffness(robot: Robot, cable: Cable, compliance: float) -> float | None:
    """Return the axial stiffness in N of a cable with a compliance in m/N from capstan to end; None: without stretch.

    A cable whose line is described to stretch keeps a number, so that the file's defaults do not give it the old one back.
    """
    length = robot.line_length(cable)
    if compliance > length / _STIFFEST:
        return length / compliance
    return _STIFFEST if cable.stretches else None
