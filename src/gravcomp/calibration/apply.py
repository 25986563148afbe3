"""Calibrated values in the descriptions of robot and motors, and the file that lays them over the robot's."""

import dataclasses
import datetime
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gravcomp.calibration.motion import MotionFit
from gravcomp.calibration.parameters import StaticParameters, with_cable_places, with_moduli
from gravcomp.calibration.pose_prediction import with_moved_cables
from gravcomp.calibration.poses import PoseParameters
from gravcomp.config import ConfigError
from gravcomp.description import Cable, PronyTerm, Robot, load_robot_file, shipped_robots
from gravcomp.description.hardware import Hardware
from gravcomp.description.overlay import make_paths_whole
from gravcomp.description.suited_capstan import has_motors
from gravcomp.orientation.calibration import RestCalibration
from gravcomp.orientation.imu_calibration import ImuCalibration

if TYPE_CHECKING:
    from ruamel.yaml import YAML

_LEAST_STRETCH = 1e-5  # at the largest tension: a cable that stretches less is described as inextensible
_NO_CREEP = 1e-4  # ratio of a branch that is not described


def calibrated_robot(
    robot: Robot,
    parameters: StaticParameters,
    creep_times: tuple[float, ...] = (),
) -> Robot:
    """Return the robot with the fitted parameters; creep_times: of its branches in s."""
    robot = with_cable_places(robot, parameters.radius, parameters.angle)
    cables = tuple(
        dataclasses.replace(
            cable.with_stiffness(_stiffness(robot, cable, float(compliance))),
            friction=cable.friction if not parameters.friction else (cable.friction or 0.0) + parameters.friction,
        )
        for cable, compliance in zip(robot.cables, parameters.compliance)
    )
    if creep_times:
        robot = robot.with_material(prony=_terms(parameters.creep, creep_times), creep_ratio=0.0)
    moduli = np.broadcast_to(parameters.youngs_modulus, len(robot.materials))
    robot = with_moduli(robot, moduli)
    robot = robot.with_materials([dataclasses.replace(m, density=parameters.density * m.density) for m in robot.materials])
    return dataclasses.replace(
        robot,
        cables=cables,
        payload=dataclasses.replace(robot.payload, mass=parameters.payload * robot.payload.mass),
        imu_mount=dataclasses.replace(robot.imu_mount, rpy=_turned(robot.imu_mount.rpy, parameters.mount)),
    )


def _terms(ratio: np.ndarray, times: tuple[float, ...]) -> tuple[PronyTerm, ...]:
    """Return the Prony series of branches of these ratios (b,) to the long-term stiffness."""
    whole = 1.0 + float(ratio.sum())
    return tuple(PronyTerm(share=float(one) / whole, time=time) for one, time in zip(ratio, times) if one > _NO_CREEP)


def _turned(rpy: tuple[float, float, float], mount: np.ndarray) -> tuple[float, float, float]:
    """Return roll, pitch, yaw in rad after a further turn by the rotation vector `mount` (3,)."""
    from scipy.spatial.transform import Rotation

    if not mount.any():
        return rpy
    roll, pitch, yaw = (Rotation.from_rotvec(mount) * Rotation.from_euler("xyz", rpy)).as_euler("xyz")
    return float(roll), float(pitch), float(yaw)


def with_behaviour(robot: Robot, motion: MotionFit) -> Robot:
    """Return the robot with the damping time and, if it was fitted, the creep that its motion shows."""
    found = motion.robot.materials[0]
    if not np.isfinite(motion.creep_ratio_interval):
        return robot.with_material(damping_time=found.damping_time)
    return robot.with_material(
        damping_time=found.damping_time, creep_ratio=found.creep_ratio, creep_time=found.creep_time, prony=()
    )


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


def calibrated_imu(imu: ImuCalibration, robot: Robot, parameters: StaticParameters) -> ImuCalibration:
    """Return the IMU with the fitted bias in its offset; `imu` and the mount of `robot`: as gravity was measured with."""
    if not parameters.bias.any():
        return imu
    own = robot.imu_mount.rotation.T @ parameters.bias / np.array(imu.accel_scale)
    x, y, z = (np.array(imu.accel_offset) + own).tolist()
    return dataclasses.replace(imu, accel_offset=(x, y, z))


def robot_of_poses(robot: Robot, parameters: PoseParameters) -> Robot:
    """Return the robot with the modulus and the places of the cables that were fitted to poses."""
    return with_moved_cables(robot.with_material(youngs_modulus=parameters.youngs_modulus), parameters)


def overlay_path(source: str | Path, name: str) -> Path:
    """Return where a calibrated robot goes by default: next to the robot file; for a shipped robot into the present folder."""
    path = Path(source)
    shipped = path.resolve() in [one.resolve() for one in shipped_robots().values()]
    return (Path() if shipped else path.parent) / f"{name}-calibrated.yaml"


def write_calibrated(
    source: str | Path,
    target: str | Path,
    before: Robot,
    robot: Robot,
    hardware: Hardware | None,
    virtual_seed: int | None = None,
    origin: dict[str, Any] | None = None,
    imu: ImuCalibration | None = None,
) -> None:
    """Write to `target` what is different in `robot` from `before`, the robot of the file `source`, and the motors' offsets.

    The new file names `source` as its `base`, so that what is changed there later still counts. virtual_seed: of the virtual
    robot that was measured; the new file names `source` as its description, because a virtual robot drawn around the calibrated
    values would be another one. origin: where the values are from, for the key `calibration`; imu: with another offset of the
    accelerometer, None: it keeps that of the file. Raises ConfigError if it cannot be written, and for a target that is the
    source.
    """
    source, target = Path(source), Path(target)
    if target.exists() and target.samefile(source):
        raise ConfigError(f"{target}: is the robot file that was calibrated, and is not overwritten; give --write another name")
    shipped = {path.resolve(): name for name, path in shipped_robots().items()}
    base = shipped.get(source.resolve()) or (
        source.name if source.resolve().parent == target.resolve().parent else str(source.resolve())
    )
    document: dict[str, Any] = {"base": base}
    if origin is not None:
        document["calibration"] = origin
    document["robot"] = _changed_robot(before, robot)
    with_motors = has_motors(dict(load_robot_file(source).sections.get("hardware") or {}))
    if hardware is not None and (with_motors or hardware.drive.capstan_assumed):
        document["hardware"] = _changed_hardware(hardware, with_motors)
    if imu is not None:
        offset = [round(value, 5) for value in imu.accel_offset]
        document["nodes"] = {"imu_estimator": {"calibration": {"accel_offset": offset}}}
    if virtual_seed is not None:
        document["virtual_robot"] = {"description": base, "seed": virtual_seed}
    about = f"Calibrated on {datetime.date.today().isoformat()}. What is not given here is in the file that `base` names."
    _write(document, target, about)


def _changed_hardware(hardware: Hardware, with_motors: bool) -> dict[str, Any]:
    """Return the fitted keys of the section `hardware`; with_motors: of a file that describes them.

    Assumed capstans follow from the robot, and so from the values that are calibrated: those that the data belong to are written.
    """
    drive: dict[str, Any] = {"capstan_radius_mm": round(hardware.drive.capstan_radius * 1e3, 5)}
    if hardware.drive.capstan_assumed:
        drive["capstan_assumed"] = True
    if not with_motors:
        return {"drive": drive}
    motors = [
        {"cable": motor.cable, "can_id": motor.can_id, "offset_mm": round(motor.offset * 1e3, 4)} for motor in hardware.motors
    ]
    return {"drive": drive, "motors": motors}


def _changed_robot(before: Robot, robot: Robot) -> dict[str, Any]:
    """Return the keys of the section `robot` whose values changed."""
    section: dict[str, Any] = {}
    materials = [_changed_material(a, b) for a, b in zip(before.materials, robot.materials)]
    if robot.body is not None:
        section["body"] = {"material": materials[0]}
    else:
        section["segments"] = [{"name": s.name, "material": found} for s, found in zip(robot.segments, materials)]
    cables = [_changed_cable(a, b) for a, b in zip(before.cables, robot.cables)]
    if any(len(found) > 1 for found in cables):
        section["cables"] = cables
    if robot.payload.mass != before.payload.mass:
        section["payload"] = {"mass_g": round(1e3 * robot.payload.mass, 4)}
    if robot.imu_mount.rpy != before.imu_mount.rpy:
        section["imu_mount"] = {"rpy_deg": [round(math.degrees(angle), 4) for angle in robot.imu_mount.rpy]}
    return section


def _changed_material(before: Any, after: Any) -> dict[str, Any]:
    """Return the keys of a material whose values changed; modulus and damping time always."""
    found: dict[str, Any] = {
        "youngs_modulus_mpa": round(after.youngs_modulus * 1e-6, 5),
        "damping_time_ms": round(after.damping_time * 1e3, 3),
    }
    if after.density != before.density:
        found["density"] = round(after.density, 2)
    if after.branches != before.branches:
        found |= {"creep_ratio": None, "creep_time": None, "prony": None}
        if after.prony:
            found["prony"] = [{"share": round(term.share, 5), "time_s": round(term.time, 4)} for term in after.prony]
        elif after.creep_ratio:
            found |= {"creep_ratio": round(after.creep_ratio, 5), "creep_time": round(after.creep_time, 4)}
    return found


def _changed_cable(before: Cable, after: Cable) -> dict[str, Any]:
    """Return the keys of a cable whose values changed, and its name."""
    found: dict[str, Any] = {"name": after.name}
    if after.axial_stiffness is not None and after.axial_stiffness != before.axial_stiffness:
        found |= {"material": None, "diameter_mm": None, "axial_stiffness": round(after.axial_stiffness, 2)}
    if after.friction != before.friction and after.friction is not None:
        found["friction"] = round(after.friction, 4)
    if after.via_points is not None:
        if after.via_points != before.via_points:
            found["via_points_mm"] = [[round(1e3 * value, 4) for value in point] for point in after.via_points]
        return found
    assert after.angle is not None and after.radius is not None  # Cable.__post_init__
    if after.angle != before.angle:
        found["angle_deg"] = round(math.degrees(after.angle), 3)
    if after.radius != before.radius:
        found["radius_mm"] = round(1e3 * after.radius, 4)
    if after.tip_radius is not None and after.tip_radius != before.tip_radius:
        found["tip_radius_mm"] = round(1e3 * after.tip_radius, 4)
    return found


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
        _set_mount(document, found.mount)
    _write_copy(document, source, target)


def write_mount(source: str | Path, target: str | Path, rpy: tuple[float, float, float]) -> None:
    """Write the robot's file `source` to `target` with the mount of the IMU: roll, pitch, yaw in rad. Raises ConfigError."""
    document = _document(source)
    _set_mount(document, rpy)
    _write_copy(document, source, target)


def _write_copy(document: dict, source: str | Path, target: str | Path) -> None:
    """Write the changed document of the file `source` to `target`; in another folder its paths still lead to the same files."""
    folder = Path(source).resolve().parent
    if Path(target).resolve().parent != folder:
        make_paths_whole(document, folder)
    _write(document, target)


def _set_mount(document: dict, rpy: tuple[float, float, float]) -> None:
    """Write roll, pitch, yaw in rad into the document; one on a base may have no section `robot` yet."""
    _section(_section(document, "robot"), "imu_mount")["rpy_deg"] = [round(math.degrees(angle), 4) for angle in rpy]


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
    length, stiffest = robot.line_length(cable), robot.limits.tension_max / _LEAST_STRETCH
    if compliance > length / stiffest:
        return length / compliance
    return stiffest if cable.stretches else None
