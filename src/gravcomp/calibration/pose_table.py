"""Measured poses from a table as others lay it out, read through a mapping."""

import math
import re
from pathlib import Path

import numpy as np

from gravcomp.calibration.csv_table import CsvTable
from gravcomp.calibration.mapping import UNITS, Mapping, MarkerColumns
from gravcomp.calibration.measured import MeasurementError
from gravcomp.calibration.plausible import check_gravity
from gravcomp.calibration.poses import Poses
from gravcomp.description import PointLoad

_SUFFIX = re.compile(r"_(mm|cm|m|kg|g|n|mn)$", re.IGNORECASE)
_SAME_SCALE = 4.0  # largest ratio of measured to described distances between markers, and its inverse
_STRAIGHT = 1e-3  # spread across the line over spread along it, below which base markers lie on one line


def read_poses(path: str | Path, mapping: Mapping, cables: tuple[str, ...]) -> Poses:
    """Read a CSV file with a header and one row for each pose.

    Raises MeasurementError, naming file, line and column, for a missing column, a cell that is empty or not a number, a column
    whose name ends in another unit than the mapping says, gravity or markers in another unit, and a cable that the robot does
    not have.
    """
    table = CsvTable.read(Path(path).expanduser())
    if not table.rows:
        raise MeasurementError(f"{path}: contains no rows below its header")
    commands = _commands(table, mapping, cables)
    count = len(table.rows)
    turn, origin = _frames(table, mapping)
    gravity = np.tile(np.array(mapping.gravity or (0.0, 0.0, 0.0)), (count, 1))
    if mapping.gravity_columns is not None:
        gravity = np.column_stack([_column(table, name) for name in mapping.gravity_columns])
    for line, length in zip(table.lines, np.linalg.norm(gravity, axis=1)):  # none: for a robot that lies on a plane
        check_gravity(float(length), f"{path}, line {line}", or_none=True)
    masses = [_column(table, entry.column, entry.unit) for entry in mapping.mass_columns]
    loads = tuple(
        (*mapping.loads, *(PointLoad(e.at, float(m[k])) for e, m in zip(mapping.mass_columns, masses) if m[k]))
        for k in range(count)
    )
    measured = np.stack([_place(table, marker) for marker in mapping.markers], axis=1)
    _check_scale(table, measured, np.array([marker.at for marker in mapping.markers]))
    driven = mapping.cables.input if mapping.cables else None
    return Poses(
        source=str(path),
        name=tuple(table.texts(mapping.pose) if mapping.pose else (f"line {line}" for line in table.lines)),
        gravity=np.einsum("kji,kj->ki", turn, gravity),
        tension=commands if driven == "tension" else None,
        displacement=commands if driven == "displacement" else None,
        loads=loads,
        marker_name=tuple(marker.name for marker in mapping.markers),
        at=np.array([marker.at for marker in mapping.markers]),
        measured=np.einsum("kji,kpj->kpi", turn, measured - origin[:, None]),
    )


def _column(table: CsvTable, name: str, unit: str = "") -> np.ndarray:
    """Return a column in SI; `unit` is that of its cells. Raises MeasurementError where its name ends in another one."""
    table.require([name])
    suffix = _SUFFIX.search(name)
    if unit and suffix and suffix.group(1).lower() != unit.lower():
        raise MeasurementError(
            f"{table.path}: the column '{name}' ends in the unit {suffix.group(1)}, and the mapping says {unit}"
        )
    return table.numbers(name, UNITS.get(unit, 1.0))


def _check_scale(table: CsvTable, measured: np.ndarray, at: np.ndarray) -> None:
    """Raise MeasurementError where the markers (k, p, 3) are many times as far from each other as they are described (p, 3).

    A robot that curls up brings its markers together, but not all of them in all poses; nothing draws most of them so far apart.
    """
    one, other = np.triu_indices(len(at), 1)
    described = np.linalg.norm(at[one] - at[other], axis=1)
    if not len(one) or not described.any():
        return
    found = np.linalg.norm(measured[:, one] - measured[:, other], axis=2)[:, described > 0.0] / described[described > 0.0]
    ratio, largest = float(np.median(found)), float(np.quantile(found, 0.9))
    if ratio <= _SAME_SCALE and largest >= 1.0 / _SAME_SCALE:
        return
    raise MeasurementError(
        f"{table.path}: the markers are {float(f'{ratio:.3g}'):g} times as far from each other as at_mm of the mapping says: is"
        " their unit in the mapping right, and are they the same markers?"
    )


def _place(table: CsvTable, marker: MarkerColumns) -> np.ndarray:
    """Return the measured places (k, 3) of a marker in m."""
    return np.column_stack([_column(table, name, marker.unit) for name in marker.columns])


def _commands(table: CsvTable, mapping: Mapping, cables: tuple[str, ...]) -> np.ndarray | None:
    """Return what drives the cables (k, m) in SI; None if all are released."""
    if mapping.cables is None:
        return None
    unknown = [name for name in mapping.cables.columns if name not in cables]
    if unknown:
        raise MeasurementError(
            f"{table.path}: the mapping names the cable '{unknown[0]}'; the robot has {', '.join(cables) or 'none'}"
        )
    released = 0.0 if mapping.cables.input == "tension" else math.nan
    values = np.full((len(table.rows), len(cables)), released)
    for name, column in mapping.cables.columns.items():
        values[:, cables.index(name)] = mapping.cables.sign * _column(table, column, mapping.cables.unit)
    if mapping.cables.input == "tension" and (values < 0.0).any():
        row, cable = np.argwhere(values < 0.0)[0]
        raise MeasurementError(
            f"{table.path}, line {table.lines[row]}: the tension of '{cables[cable]}' is {values[row, cable]:g} N;"
            " a cable cannot push"
        )
    return values


def _frames(table: CsvTable, mapping: Mapping) -> tuple[np.ndarray, np.ndarray]:
    """Return orientation (k, 3, 3) and origin (k, 3) of soft_base in the frame of measurement for every row."""
    from scipy.spatial.transform import Rotation

    frame, count = mapping.frame, len(table.rows)
    if not frame.markers:
        turn = Rotation.from_euler("xyz", frame.rpy).as_matrix()
        return np.tile(turn, (count, 1, 1)), np.tile(np.array(frame.position), (count, 1))
    at = np.array([marker.at for marker in frame.markers])
    spread = np.linalg.svd(at - at.mean(axis=0), compute_uv=False)
    if spread[1] < _STRAIGHT * spread[0]:
        raise MeasurementError(f"{table.path}: the markers on the base lie on one line; a pose needs at least 3 that do not")
    measured = np.stack([_place(table, marker) for marker in frame.markers], axis=1)
    turns, origins = [], []
    for places in measured:
        rotation, _ = Rotation.align_vectors(places - places.mean(axis=0), at - at.mean(axis=0))
        turns.append(rotation.as_matrix())
        origins.append(places.mean(axis=0) - rotation.apply(at.mean(axis=0)))
    return np.array(turns), np.array(origins)
