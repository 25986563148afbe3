"""Measured courses of the tip in files.

A CSV file has a header and one row per sample:

    trial, time_s, gravity_x, gravity_y, gravity_z (m/s^2, in soft_base), CABLE_mm for every cable (empty: released),
    tip_x_mm, tip_y_mm, tip_z_mm (in soft_base), and, if measured, direction_x, direction_y, direction_z

`trial` may be missing if there is only one. A bag has `gravity`, `cable/state` and the tip as geometry_msgs/PoseStamped.
"""

import csv
import math
from pathlib import Path

import numpy as np

from gravcomp.calibration.bag import read_bag
from gravcomp.calibration.measured import Measured, MeasurementError


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
        writer.writerow(csv_header(cables, directed))
        for row in range(len(measured.time)):
            direction = None if measured.tip_direction is None else measured.tip_direction[row]
            writer.writerow(
                csv_row(
                    int(measured.trial[row]), float(measured.time[row]), measured.gravity[row], measured.displacement[row],
                    measured.tip_position[row], direction,
                )
            )  # fmt: skip


def csv_header(cables: tuple[str, ...], directed: bool) -> list[str]:
    """Return the header of such a file; directed: with the tip's direction."""
    gravity, tip = ["gravity_x", "gravity_y", "gravity_z"], ["tip_x_mm", "tip_y_mm", "tip_z_mm"]
    direction = ["direction_x", "direction_y", "direction_z"] if directed else []
    return ["trial", "time_s", *gravity, *(f"{name}_mm" for name in cables), *tip, *direction]


def csv_row(
    trial: int, time: float, gravity: np.ndarray, displacement: np.ndarray, tip: np.ndarray, direction: np.ndarray | None
) -> list:
    """Return the row of one sample, in SI."""
    wound = ["" if math.isnan(x) else f"{1e3 * x:.4f}" for x in displacement]
    values = [f"{x:.5f}" for x in gravity] + wound + [f"{1e3 * x:.4f}" for x in tip]
    return [trial, f"{time:.4f}", *values, *([] if direction is None else [f"{x:.6f}" for x in direction])]


def _read_csv(path: Path, cables: tuple[str, ...]) -> Measured:
    """Return the measurement in a CSV file. Raises MeasurementError."""
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.DictReader(file)
            header, rows = reader.fieldnames or [], list(reader)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise MeasurementError(f"{path}: cannot be read as CSV: {error}") from error
    wound = [f"{name}_mm" for name in cables]
    needed = ["time_s", "gravity_x", "gravity_y", "gravity_z", *wound, "tip_x_mm", "tip_y_mm", "tip_z_mm"]
    missing = [name for name in needed if name not in header]
    if missing:
        raise MeasurementError(
            f"{path}: the column '{missing[0]}' is missing; needed: {', '.join(needed)}; found: {', '.join(header)}"
        )

    def column(name: str, empty: float | None = None, scale: float = 1.0) -> np.ndarray:
        values = []
        for line, row in enumerate(rows, start=2):
            text = (row[name] or "").strip()
            try:
                values.append(empty if not text and empty is not None else float(text))
            except ValueError as error:
                raise MeasurementError(f"{path}, line {line}: {name} is '{text}'; a number is needed") from error
        return np.array(values, dtype=float) * scale

    directions = [f"direction_{axis}" for axis in "xyz"]
    return Measured(
        source=str(path),
        trial=column("trial").astype(int) if "trial" in header else np.zeros(len(rows), dtype=int),
        time=column("time_s"),
        gravity=np.column_stack([column(f"gravity_{axis}") for axis in "xyz"]),
        displacement=np.column_stack([column(name, empty=math.nan, scale=1e-3) for name in wound]),
        tip_position=np.column_stack([column(f"tip_{axis}_mm", scale=1e-3) for axis in "xyz"]),
        tip_direction=np.column_stack([column(name) for name in directions]) if set(directions) <= set(header) else None,
    )
