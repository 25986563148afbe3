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

from gravcomp.calibration.csv_table import CsvTable
from gravcomp.calibration.measured import MeasurementError, StillWindows
from gravcomp.calibration.plan import Plan, PlannedPose
from gravcomp.description import Robot

_SHOWN, _WRITTEN = 2e-2, 1e-3  # of the largest pull: steps of pulls that are read and of those that are computed with
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
    decimals = _decimals(pose.displacement, _SHOWN)
    found = [
        f"{name} {1e3 * value:+.{decimals}f} mm ({force:.2g} N)"
        for name, value, force in zip(robot.cable_names, pose.displacement, pose.tension)
        if name in pose.pulled
    ]
    return ", ".join(found) or "all cables released"


def write_plan_table(plan: Plan, robot: Robot, path: Path) -> None:
    """Write the table to fill in."""
    decimals = max(_decimals(np.concatenate([pose.displacement for pose in plan.poses]), _WRITTEN), 2)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        wound = [f"{name}_mm" for name in robot.cable_names]
        writer.writerow(["pose", "inclination_deg", "roll_deg", *_GRAVITY, *wound, *_TIP])
        for number, pose in enumerate(plan.poses, start=1):
            pulled = [
                f"{1e3 * value:.{decimals}f}" if name in pose.pulled else ""
                for name, value in zip(robot.cable_names, pose.displacement)
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
    table = CsvTable.read(path)
    wound = [f"{name}_mm" for name in cables]
    table.require([*_GRAVITY, *wound, *_TIP], "; is the table of another robot?")
    filled = table.only([any(row[name] for name in _TIP) for row in table.rows])
    if len(filled.rows) < _FEWEST:
        raise MeasurementError(f"{path}: {len(filled.rows)} rows have a tip; at least {_FEWEST} are needed")
    return StillWindows(filled.vectors(_GRAVITY), filled.vectors(wound, 1e-3, empty=math.nan), filled.vectors(_TIP, 1e-3))


def _decimals(displacement: np.ndarray, step: float) -> int:
    """Return the decimals of mm, at least one, that are as fine as `step` of the largest displacement in m; NaN: released."""
    largest = float(np.nanmax(np.abs(displacement), initial=0.0))
    return 1 if largest == 0.0 else max(1, math.ceil(-math.log10(1e3 * largest * step)))
