"""A plan as a JSON file, from the command that makes it to the node that leads through it."""

import json
from pathlib import Path

import numpy as np

from gravcomp.calibration.measured import MeasurementError
from gravcomp.calibration.plan import Plan, PlannedPose
from gravcomp.whole_file import write_whole

_ARRAYS = ("displacement", "tension", "tip")


def save_plan(plan: Plan, path: Path) -> None:
    """Write the plan. Raises OSError."""
    poses = [{name: np.asarray(value).tolist() for name, value in vars(pose).items()} for pose in plan.poses]
    write_whole(path, json.dumps({**vars(plan), "poses": poses}), lasting=True)


def load_plan(path: Path) -> Plan:
    """Return the plan in a file. Raises MeasurementError for one that cannot be read as a plan."""
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
        poses = [
            PlannedPose(**{**entry, "pulled": tuple(entry["pulled"]), **{name: np.array(entry[name]) for name in _ARRAYS}})
            for entry in document["poses"]
        ]
        return Plan(tuple(poses), tuple(document["times"]), document["rest"], document["rate"], document.get("note", ""))
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise MeasurementError(f"{path}: cannot be read as a plan: {error}") from error
