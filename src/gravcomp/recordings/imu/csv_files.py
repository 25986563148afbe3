"""IMU recordings as CSV: one file, or a folder with a file for each sensor (phone apps) or in EuRoC's tree.

What the columns are: `csv_columns`. The samples of a file for each sensor are those of the gyroscope, with the specific force of
the same time by linear interpolation.
"""

from pathlib import Path

import numpy as np

from gravcomp.config import from_mapping, load_yaml
from gravcomp.recordings.bags.storage import storage_files
from gravcomp.recordings.imu.csv_columns import CsvColumns, Found, by_mapping, by_names
from gravcomp.recordings.imu.csv_text import Table, read_table
from gravcomp.recordings.imu.csv_units import ACCEL_UNITS, GYRO_UNITS, TIME_UNITS
from gravcomp.recordings.imu.recording import Recording, RecordingError
from gravcomp.recordings.imu.stamps import nearest, usable_stamps

SUFFIXES = (".csv", ".txt", ".tsv", ".dat", ".log")
_RATES = (5.0, 8000.0)  # Hz, of an IMU whose unit of time is not given
_TICKS = {"sampletimefine": (100_000, 1_000)}  # ns: counters of Xsens (0.1 ms) and Movella (us)
_TRUTHS = ("state_groundtruth_estimate0", "mocap0")  # of EuRoC and TUM-VI, next to imu0
_TREE = ("mav0/imu0/data.csv", "imu0/data.csv", "data.csv")
_NEEDED = "needed: time, rate x y z, specific force x y z; or their names in a file for --columns"


def is_csv(path: Path) -> bool:
    """Whether a path is a CSV file, or a folder with some and without a bag."""
    if path.is_dir():
        bag = (path / "metadata.yaml").exists() or bool(storage_files(path))
        return not bag and (any(path.glob("*.csv")) or any((path / place).exists() for place in _TREE))
    return path.suffix.lower() in SUFFIXES


def read_mapping(path: str) -> CsvColumns:
    """Read a mapping of columns from a YAML file. Raises ConfigError."""
    return from_mapping(CsvColumns, load_yaml(Path(path)), source=path)


def read_csv(path: Path, mapping: CsvColumns | None = None) -> Recording:
    """Return the IMU stream of a file or folder. Raises RecordingError, which names what was found and what is needed."""
    if not path.is_dir():
        return _of_file(path, mapping)
    for place in _TREE:
        if (path / place).exists():
            return _of_file(path / place, mapping)
    return _of_folder(path)


def _of_file(path: Path, mapping: CsvColumns | None) -> Recording:
    table = read_table(path)
    found = by_names(table.names, path.stem, table.source) if mapping is None else by_mapping(table.names, mapping, table.source)
    if not found.gyro or not found.accel:
        lacks = " and ".join(name for name, axes in (("a rate", found.gyro), ("a specific force", found.accel)) if not axes)
        names = ", ".join(name or "-" for name in table.names)
        raise RecordingError(f"{path}: lacks {lacks}; found the columns: {names}; {_NEEDED}")
    if found.linear:
        raise RecordingError(f"{path}: has the acceleration without gravity; the specific force is needed")
    gyro, accel = _vectors(table, found.gyro), _vectors(table, found.accel)
    stamp, notes = _stamps(table, found, None if mapping is None else mapping.rate, np.hstack([gyro, accel]))
    truth = _vectors(table, found.orientation) if found.orientation else _truth_next_to(path, stamp)
    return Recording(
        source=str(path),
        stamp_ns=stamp,
        gyro=gyro * GYRO_UNITS[found.gyro_unit or "rad/s"],
        accel=accel * ACCEL_UNITS[found.accel_unit or "m/s^2"],
        orientation=truth,
        notes=(*notes, *_converted(found)),
    )


def _of_folder(path: Path) -> Recording:
    """Return the recording of a folder with a file for each sensor."""
    files = sorted(path.glob("*.csv"))
    beginnings = {file: _beginning(file) for file in files}
    found = {file: by_names(table.names, file.stem, table.source) for file, table in beginnings.items() if table is not None}
    for file, columns in found.items():
        if columns.gyro and columns.accel and not columns.linear:
            return _of_file(file, None)
    gyros = [file for file, columns in found.items() if columns.gyro and "uncal" not in file.stem.lower()]
    gravity = [file for file in files if file.stem.lower() == "gravity"]
    accels = [f for f, c in found.items() if c.accel and f not in gravity and not c.linear and "uncal" not in f.stem.lower()]
    accels.sort(key=lambda file: "total" not in file.stem.lower())
    if not gyros or not accels:
        names = ", ".join(file.name for file in files)
        raise RecordingError(f"{path}: has no file of a gyroscope and one of an accelerometer; found: {names}; {_NEEDED}")
    columns = found[gyros[0]]
    stamp, gyro, notes = _sensor(gyros[0], columns, columns.gyro, GYRO_UNITS[columns.gyro_unit or "rad/s"])
    parts = [accels[0]] if "total" in accels[0].stem.lower() else [accels[0], *gravity]
    accel = np.zeros_like(gyro)
    for part in parts:
        columns = found[part]
        times, values, more = _sensor(part, columns, columns.accel, ACCEL_UNITS[columns.accel_unit or "m/s^2"])
        accel += np.stack([np.interp(stamp, times, column, left=np.nan, right=np.nan) for column in values.T], axis=1)
        notes = (*notes, *more)
    both = np.isfinite(accel).all(axis=1)
    if np.count_nonzero(both) < 2:
        raise RecordingError(f"{path}: {gyros[0].name} and {parts[0].name} have no time in common")
    return Recording(
        source=str(path), stamp_ns=stamp[both], gyro=gyro[both], accel=accel[both], notes=tuple(dict.fromkeys(notes))
    )


def _sensor(path: Path, found: Found, axes: tuple[int, ...], unit: float) -> tuple[np.ndarray, np.ndarray, tuple[str, ...]]:
    """Return stamps (n,) in ns, values (n, 3) in SI of the columns `axes`, and what was repaired; unit: of the columns, in SI."""
    table = read_table(path)
    values = _vectors(table, axes)
    stamp, notes = _stamps(table, found, None, values)
    return stamp, values * unit, (*notes, *_converted(found))


def _beginning(path: Path) -> Table | None:
    """Return the first rows of a file, None for one without numbers."""
    try:
        return read_table(path, longest=2)
    except RecordingError:
        return None


def _vectors(table: Table, columns: tuple[int, ...]) -> np.ndarray:
    return np.stack([table.numbers(column) for column in columns], axis=1)


def _stamps(table: Table, found: Found, rate: float | None, values: np.ndarray) -> tuple[np.ndarray, tuple[str, ...]]:
    """Return the stamps (n,) in ns, and what was repaired."""
    if found.time is None:
        if rate is None:
            names = ", ".join(name or "-" for name in table.names)
            raise RecordingError(f"{table.source}: has no column of time among {names}; give it or rate by --columns")
        return np.rint(np.arange(len(table.rows)) * (1e9 / rate)).astype(np.int64), ()
    if (clock := table.clock_times(found.time)) is not None:
        return usable_stamps(clock, None, values)
    numbers, whole = _finite(table, found.time), table.whole_numbers(found.time)
    scale = TIME_UNITS[found.time_unit] if found.time_unit else _time_scale(numbers, table, found.time)
    stamp = np.rint(numbers * scale).astype(np.int64) if whole is None else np.array([x * scale for x in whole], np.int64)
    if found.nanoseconds is not None:
        stamp = stamp + _finite(table, found.nanoseconds).astype(np.int64)
    return usable_stamps(stamp, None, values)


def _finite(table: Table, column: int) -> np.ndarray:
    """Return a column (n,) of numbers. Raises RecordingError where one is none."""
    numbers = table.numbers(column)
    if not np.isfinite(numbers).all():
        row = int(np.argmin(np.isfinite(numbers))) + 1
        raise RecordingError(f"{table.source}: column '{table.names[column]}' is no number in row {row}")
    return numbers


def _time_scale(times: np.ndarray, table: Table, column: int) -> int:
    """Return the unit of a column of times (n,) in ns, with which their steps are those of an IMU. Raises RecordingError."""
    if len(times) < 2:
        raise RecordingError(f"{table.source}: has {len(times)} IMU samples; at least 2 are needed")
    steps = np.diff(times)
    if not (steps > 0).any():
        raise RecordingError(f"{table.source}: the time does not advance: it goes from {times[0]:g} to {times[-1]:g}")
    step = float(np.median(steps[steps > 0]))
    for scale in _TICKS.get(table.names[column].lower(), tuple(TIME_UNITS.values())):
        if _RATES[0] <= 1e9 / (step * scale) <= _RATES[1]:
            return scale
    raise RecordingError(f"{table.source}: the steps of time are {step:g}, in no known unit; give time_unit by --columns")


def _converted(found: Found) -> tuple[str, ...]:
    """Say which units were converted because the header names them."""
    pairs = (("gyroscope", found.gyro_unit, "rad/s"), ("accelerometer", found.accel_unit, "m/s^2"))
    return tuple(f"the {name} is in {unit} by its header: converted" for name, unit, si in pairs if unit not in (None, si))


def _truth_next_to(path: Path, stamp: np.ndarray) -> np.ndarray | None:
    """Return the ground truth of EuRoC's tree (n, 4), where there is one."""
    for name in _TRUTHS:
        file = path.parent.parent / name / "data.csv"
        if path.parent.name == "imu0" and file.exists():
            table = read_table(file)
            found = by_names(table.names, "", table.source)
            if found.orientation and found.time is not None and (times := table.whole_numbers(found.time)):
                return nearest(stamp, np.array(times, np.int64), _vectors(table, found.orientation))
    return None
