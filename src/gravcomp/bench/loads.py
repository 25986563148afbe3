"""External loads: wrenches against SoRoSim, and loads that the virtual robot carries and the loop has to find.

The payload is a share of the robot's own mass. The tip forces act across the robot, as a wall does, and, listed apart,
along it, where the body is so stiff that neither sensor sees much. The robot is compensated for the payload, not for the
forces. Trackers and load cells are those of the options' defaults. The base's IMU cannot contribute on an arm that moves the
base by itself: `payload_imu_frames` counts the IMU frames of the virtual robot that a payload changes.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from gravcomp.canbus.imu_stream import IMU_FRAMES
from gravcomp.closed_loop.setup import Setup
from gravcomp.description import RobotFile, load_robot_file
from gravcomp.experiments.measured import default_folder, rod_wrench
from gravcomp.full_model.robot_model import RobotModel
from gravcomp.graph.parameters.virtual_load_cells import VirtualLoadCellParameters
from gravcomp.graph.parameters.virtual_tracker import VirtualTrackerParameters
from gravcomp.sweep import Sweep
from gravcomp.trials.loaded import LoadedCase, LoadedOutcome, run_loaded
from gravcomp.virtual.motion import RotationMotion, base_orientation
from gravcomp.virtual.robot import VirtualRobot

TRACKER = VirtualTrackerParameters(rate=5.0, delay=0.1, std=0.5e-3)
CELLS = VirtualLoadCellParameters(rate=100.0, offset=0.005)
SENSORS: dict[str, dict[str, Any]] = {
    "both": {"tracker": TRACKER, "cells": CELLS},
    "tensions": {"cells": CELLS},
    "tracker": {"tracker": TRACKER},
}
PAYLOAD_SHARE = 0.15
FORCES = (0.05, 0.15, 0.5)  # N
_ALONG = 0.2  # N


def run(
    progress: Callable[[str], None], *, files: Sequence[str] = (), seeds: int = 3, rods: int = 60, brief: bool = False
) -> dict[str, Any]:
    """Return the figures of the headlines, and `cases` with what they are made of.

    files: robot files or names of shipped robots, none: article; rods: shapes of SoRoSim; brief: one size of the force and
    shorter runs, in this process. Raises ConfigError.
    """
    found: dict[str, Any] = wrenches(progress, rods) if rods else {}
    sweep, cases = Sweep(1 if brief else None), {}
    for file in files or ["article"]:
        described = load_robot_file(file)
        cases[described.robot.name] = _of(described, seeds, brief, sweep, progress)
    found |= worst(cases)
    return found | {"cases": cases}


def wrenches(progress: Callable[[str], None], count: int) -> dict[str, Any]:
    """Return `wrench_error_pct` against SoRoSim's first `count` shapes; nothing where its data are not on this machine."""
    folder = default_folder() / "rod_wrench"
    if not folder.is_dir():
        return {}
    part = rod_wrench.evaluate(folder, lambda stage: progress(f"rod under wrenches: {stage}"), count=count)
    return {"wrench_error_pct": part.data["rod_wrench_error_pct"], "wrench_median_pct": part.data["rod_wrench_median_pct"]}


def worst(cases: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """Return the headlines over all robots: payload and tip force found from tensions and tracker together, worst case."""
    rows = list(cases.values())
    keys = ("payload_error_pct", "payload_residual_mm", "force_error_pct", "force_error_deg")
    return {key: max(row["both"][key] for row in rows) for key in keys} | {
        "payload_imu_frames": max(row["imu_frames"] for row in rows),
        "payload_outside": sum(row[name]["payload_outside"] for row in rows for name in SENSORS),
    }


def _of(file: RobotFile, seeds: int, brief: bool, sweep: Sweep, progress: Callable[[str], None]) -> dict[str, Any]:
    """Return the figures of one robot by the sensors."""
    setups = [Setup.of(file, seed) for seed in range(1, seeds + 1)]
    mass = RobotModel(file.robot).mass
    random = np.random.default_rng(1)
    # The reduced model carries the smallest force, in a tenth of the time that the full one takes.
    forces, along = (FORCES[:1], FORCES[0]) if brief else (FORCES, _ALONG)
    jobs: list[tuple[str, float, tuple[Setup, LoadedCase]]] = []
    for name, sensors in SENSORS.items():
        jobs += [(name, 0.0, (setup, LoadedCase(payload=PAYLOAD_SHARE * mass, brief=brief, **sensors))) for setup in setups]
    for size in forces:
        for setup in setups:
            angle = random.uniform(0.0, 2.0 * np.pi)
            force = (size * np.cos(angle), size * np.sin(angle), 0.0)
            jobs.append(("both", size, (setup, LoadedCase(force=force, brief=brief, **SENSORS["both"]))))
    jobs.append(("along", along, (setups[0], LoadedCase(force=(0.0, 0.0, -along), brief=brief, **SENSORS["both"]))))
    outcomes = sweep.map(
        run_loaded, [job for *_, job in jobs], lambda done, total: progress(f"{file.robot.name} ({done} of {total})")
    )
    figures: dict[str, Any] = {}
    for name in SENSORS:
        own = [outcome for (key, size, _), outcome in zip(jobs, outcomes) if key == name and size == 0.0]
        figures[name] = _payload(PAYLOAD_SHARE * mass, own)
    by_size = {
        f"{size:g}": _forces([(job[1], o) for (key, one, job), o in zip(jobs, outcomes) if key == "both" and one == size])
        for size in forces
    }
    figures["both"] |= {
        "forces": by_size,
        "force_error_pct": max(row["error_pct"] for row in by_size.values()),
        "force_error_deg": max(row["error_deg"] for row in by_size.values()),
    }
    figures["along"] = _forces([(job[1], o) for (key, _, job), o in zip(jobs, outcomes) if key == "along"])
    figures["imu_frames"] = imu_frames(setups[0], PAYLOAD_SHARE * mass)
    figures["payload_g"] = 1e3 * PAYLOAD_SHARE * mass
    return figures


def _payload(mass: float, outcomes: list[LoadedOutcome]) -> dict[str, Any]:
    """Return the errors of a payload of `mass` kg: worst, the lateral tip error, and how often the interval misses it."""
    errors = [100.0 * (outcome.estimate.mass - mass) / mass for outcome in outcomes]
    intervals = [outcome.estimate.mass_interval for outcome in outcomes]
    return {
        "payload_errors_pct": errors,
        "payload_error_pct": max(map(abs, errors)),
        "payload_residual_mm": 1e3 * max(outcome.after for outcome in outcomes),
        "before_mm": 1e3 * max(outcome.before for outcome in outcomes),
        "payload_interval_g": [[1e3 * low, 1e3 * high] for low, high in intervals],
        "payload_outside": sum(not low <= mass <= high for low, high in intervals),
    }


def _forces(pairs: list[tuple[LoadedCase, LoadedOutcome]]) -> dict[str, Any]:
    """Return the errors of estimated tip forces: of the part that the sensors can see, across the robot, and of the whole.

    `errors_pct` and `errors_deg`: one for each pair; `pushed_mm`: lateral tip error of the robot, which is not compensated.
    """
    across, angles, whole, deviations = [], [], [], []
    for case, outcome in pairs:
        true, found = np.array(case.force), outcome.estimate.force
        size = float(np.linalg.norm(true))
        whole.append(100.0 * float(np.linalg.norm(found - true)) / size)
        across.append(100.0 * float(np.linalg.norm((found - true)[:2])) / size)
        cosine = float(found[:2] @ true[:2]) / max(float(np.linalg.norm(found[:2]) * np.linalg.norm(true[:2])), 1e-30)
        angles.append(float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))))
        deviations.append(float(np.sqrt(outcome.estimate.covariance[2, 2])))
    return {
        "error_pct": max(across),
        "error_deg": max(angles),
        "errors_pct": across,
        "errors_deg": angles,
        "whole_error_pct": max(whole),
        "along_std_n": max(deviations),
        "pushed_mm": 1e3 * max(outcome.after for _, outcome in pairs),
    }


def imu_frames(setup: Setup, mass: float, duration: float = 0.5) -> int:
    """Return how many IMU frames of a robot whose base is turned by an arm a payload of `mass` kg changes."""

    def frames(payload: float) -> list[bytes]:
        motion = RotationMotion(base_orientation(0.0), np.array([0.0, 1.0, 0.0]), np.radians(90.0), 0.0)
        robot = VirtualRobot(setup.truth, setup.nominal, setup.virtual_hardware, seed=setup.seed, motion=motion)
        robot.attach(payload)
        return [bytes(frame.data) for frame in robot.step(duration) if frame.arbitration_id in IMU_FRAMES]

    return sum(one != other for one, other in zip(frames(0.0), frames(mass), strict=True))
