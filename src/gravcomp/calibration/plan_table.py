"""A calibration plan on paper: what to do pose by pose, and a table to fill in, which is read back.

The table is a CSV file with one row for each pose:

    pose, inclination_deg, roll_deg, gravity_x, gravity_y, gravity_z (m/s^2, in soft_base), CABLE_mm for every cable (empty:
    released), tip_x_mm, tip_y_mm, tip_z_mm (in soft_base; empty until measured)

Gravity is that of the planned orientation; where the IMU's is known, write that. Rows without a tip are left out. A pose
counts as relaxed: the robot hangs there until nothing moves any more.
"""

import csv
import math
from pathlib import Path

import numpy as np

from gravcomp.calibration.measured import MeasurementError, StillWindows
from gravcomp.calibration.plan import Plan, PlannedPose
from gravcomp.description import Robot

_FEWEST = 3  # rows with a tip
_TIP = ("tip_x_mm", "tip_y_mm", "tip_z_mm")
_GRAVITY = ("gravity_x", "gravity_y", "gravity_z")


def instruction(pose: PlannedPose) -> str:
    """Return what to do for a pose, as a sentence without pulls in mm."""
    degrees = math.degrees(pose.inclination)
    if abs(degrees) < 0.5:
        axis = "horizontal"
    else:
        axis = f"{abs(degrees):.0f} deg {'up' if degrees > 0 else 'down'}"
    return f"axis {axis}, turned about itself by {math.degrees(pose.roll):.0f} deg"


def pulls(robot: Robot, pose: PlannedPose) -> str:
    """Return the pulls of a pose in mm, as words."""
    found = [
        f"{name} {1e3 * value:+.1f} mm ({force:.2g} N)"
        for name, value, force in zip(robot.cable_names, pose.displacement, pose.tension)
        if name in pose.pulled
    ]
    return ", ".join(found) or "all cables released"


def write_plan_table(plan: Plan, robot: Robot, path: Path) -> None:
    """Write the table to fill in."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        wound = [f"{name}_mm" for name in robot.cable_names]
        writer.writerow(["pose", "inclination_deg", "roll_deg", *_GRAVITY, *wound, *_TIP])
        for number, pose in enumerate(plan.poses, start=1):
            pulled = [
                f"{1e3 * value:.2f}" if name in pose.pulled else "" for name, value in zip(robot.cable_names, pose.displacement)
            ]
            angles = [f"{math.degrees(pose.inclination):.1f}", f"{math.degrees(pose.roll):.1f}"]
            writer.writerow([number, *angles, *(f"{x:.4f}" for x in pose.gravity), *pulled, "", "", ""])


def is_plan_table(path: Path) -> bool:
    """Return whether a file is such a table: with poses and without times."""
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            header = next(csv.reader(file), [])
    except (OSError, UnicodeDecodeError, csv.Error):
        return False
    return "pose" in header and "time_s" not in header


def read_plan_table(path: Path, cables: tuple[str, ...]) -> StillWindows:
    """Return the poses that are filled in. Raises MeasurementError."""
    with path.open(newline="", encoding="utf-8-sig") as file:
        reader = csv.DictReader(file)
        header, rows = reader.fieldnames or [], list(reader)
    wound = [f"{name}_mm" for name in cables]
    missing = [name for name in (*_GRAVITY, *wound, *_TIP) if name not in header]
    if missing:
        raise MeasurementError(
            f"{path}: the column '{missing[0]}' is missing; is the table of another robot? This one has the cables"
            f" {', '.join(cables)}; found: {', '.join(header)}"
        )
    filled = [(line, row) for line, row in enumerate(rows, start=2) if any((row[name] or "").strip() for name in _TIP)]
    if len(filled) < _FEWEST:
        raise MeasurementError(f"{path}: {len(filled)} rows have a tip; at least {_FEWEST} are needed")

    def number(line: int, row: dict, name: str, empty: float | None = None) -> float:
        text = (row[name] or "").strip()
        if not text and empty is not None:
            return empty
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise MeasurementError(f"{path}, line {line}: {name} is '{text}'; a number is needed")
        return value

    def columns(names: tuple[str, ...] | list[str], scale: float = 1.0, empty: float | None = None) -> np.ndarray:
        return scale * np.array([[number(line, row, name, empty) for name in names] for line, row in filled])

    return StillWindows(columns(_GRAVITY), columns(wound, 1e-3, math.nan), columns(_TIP, 1e-3))
