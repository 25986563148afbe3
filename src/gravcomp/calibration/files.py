"""Measured courses of the tip in files.

A CSV file has a header and one row per sample:

    trial, time_s, gravity_x, gravity_y, gravity_z (m/s^2, in soft_base), CABLE_mm for every cable (empty: released),
    tip_x_mm, tip_y_mm, tip_z_mm (in soft_base), and, if measured, direction_x, direction_y, direction_z, specific_force (m/s^2,
    its length by the IMU; empty: not measured)

`trial` may be missing if there is only one. A bag has `gravity`, `cable/state`, the tip as geometry_msgs/PoseStamped, and, where
it was recorded, `imu/data`.
"""

import csv
import math
from pathlib import Path

import numpy as np

from gravcomp.calibration.bag import read_bag
from gravcomp.calibration.csv_table import CsvTable
from gravcomp.calibration.measured import Measured, MeasurementError

FORCE = "specific_force"
"""Name of the column of the specific force's length."""

_VECTORS = (("gravity", ""), ("tip", "_mm"), ("direction", ""))
"""Names and units of the columns with three components."""


def read_measured(path: str | Path, cables: tuple[str, ...], tip_topic: str | None = None) -> Measured:
    """Read a CSV file or a rosbag2 folder. Raises MeasurementError."""
    path = Path(path).expanduser()
    if not path.exists():
        raise MeasurementError(f"{path}: does not exist; a CSV file or a rosbag2 folder is needed")
    if path.is_dir():
        return read_bag(path, cables, tip_topic)
    return _read_csv(path, cables)


def write_csv(measured: Measured, path: Path, cables: tuple[str, ...]) -> None:
    """Write a CSV file that `read_measured` reads."""
    directed = measured.tip_direction is not None
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(csv_header(cables, directed) + [FORCE] * (measured.specific_force is not None))
        for row in range(len(measured.time)):
            direction = None if measured.tip_direction is None else measured.tip_direction[row]
            force = None if measured.specific_force is None else float(measured.specific_force[row])
            writer.writerow(
                csv_row(
                    int(measured.trial[row]), float(measured.time[row]), measured.gravity[row], measured.displacement[row],
                    measured.tip_position[row], direction, force,
                )
            )  # fmt: skip


def csv_header(cables: tuple[str, ...], directed: bool) -> list[str]:
    """Return the header of such a file; directed: with the tip's direction."""
    gravity, tip = ["gravity_x", "gravity_y", "gravity_z"], ["tip_x_mm", "tip_y_mm", "tip_z_mm"]
    direction = ["direction_x", "direction_y", "direction_z"] if directed else []
    return ["trial", "time_s", *gravity, *(f"{name}_mm" for name in cables), *tip, *direction]


def csv_row(
    trial: int,
    time: float,
    gravity: np.ndarray,
    displacement: np.ndarray,
    tip: np.ndarray,
    direction: np.ndarray | None,
    force: float | None = None,
) -> list:
    """Return the row of one sample, in SI. force: length of the specific force, NaN: not measured; None: has no column."""
    wound = ["" if math.isnan(x) else f"{1e3 * x:.4f}" for x in displacement]
    values = [f"{x:.5f}" for x in gravity] + wound + [f"{1e3 * x:.4f}" for x in tip]
    values += [] if direction is None else [f"{x:.6f}" for x in direction]
    length = [] if force is None else ["" if math.isnan(force) else f"{force:.4f}"]
    return [trial, f"{time:.4f}", *values, *length]


def _read_csv(path: Path, cables: tuple[str, ...]) -> Measured:
    """Return the measurement in a CSV file. Raises MeasurementError."""
    table = CsvTable.read(path)
    gravity, tip, direction = (tuple(f"{name}_{axis}{unit}" for axis in "xyz") for name, unit in _VECTORS)
    wound = [f"{name}_mm" for name in cables]
    table.require(["time_s", *gravity, *wound, *tip])
    count = len(table.rows)
    return Measured(
        source=str(path),
        trial=table.numbers("trial").astype(int) if "trial" in table.header else np.zeros(count, dtype=int),
        time=table.numbers("time_s"),
        gravity=table.vectors(gravity),
        displacement=table.vectors(wound, 1e-3, empty=math.nan),
        tip_position=table.vectors(tip, 1e-3),
        tip_direction=table.vectors(direction) if set(direction) <= set(table.header) else None,
        specific_force=table.numbers(FORCE, empty=math.nan) if FORCE in table.header else None,
    )
