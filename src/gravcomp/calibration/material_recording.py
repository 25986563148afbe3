"""A recorded relaxation or creep test of a material: one column of times, and one of what relaxes or creeps.

Relaxation: stress, force or modulus at a strain that is held. Creep: strain, displacement or compliance under a load that is
held. Time begins when the strain or load is reached. Only the shape of the course counts, so the unit of the column does not.
"""

import dataclasses
from pathlib import Path

import numpy as np

from gravcomp.calibration.csv_table import CsvTable
from gravcomp.calibration.measured import MeasurementError

_TIMES = {"time_ms": 1e-3, "time_s": 1.0, "time_min": 60.0, "time_h": 3600.0}
_RELAXATION = ("stress", "force", "torque", "modulus")
_CREEP = ("strain", "displacement", "elongation", "deflection", "compliance")
_LEAST = 8  # samples after the start
_DECADES = 1.0  # from the first to the last of them


@dataclasses.dataclass(frozen=True)
class MaterialTest:
    """time (k,) in s, increasing, from the start of the held strain or load; value (k,), positive; creep: else relaxation."""

    source: str
    column: str
    time: np.ndarray
    value: np.ndarray
    creep: bool

    @property
    def what(self) -> str:
        """What was recorded, in one word."""
        return "creep" if self.creep else "relaxation"


def read_material_recording(path: str | Path) -> MaterialTest:
    """Read a CSV file with a header. Samples at or before the time 0 are left out.

    Raises MeasurementError, naming file, line and column, for other columns, cells that are no numbers, times that do not
    increase, values of both signs, and too few samples.
    """
    table = CsvTable.read(Path(path).expanduser())
    clock = _only(table, [name for name in table.header if name in _TIMES], "time", ", ".join(_TIMES))
    quantities = [*_RELAXATION, *_CREEP]
    found = [name for name in table.header if name.split("_")[0] in quantities]
    column = _only(table, found, "course", f"a name that begins with {', '.join(quantities)}, and goes on with _ and the unit")
    time, value = table.numbers(clock, _TIMES[clock]), table.numbers(column)
    back = np.flatnonzero(np.diff(time) <= 0.0)
    if len(back):
        line = table.lines[back[0] + 1]
        raise MeasurementError(f"{path}, line {line}: {clock} does not increase; give one course, in the order of time")
    after = time > 0.0
    time, value = time[after], value[after]
    if len(time) < _LEAST or time[-1] < 10.0**_DECADES * time[0]:
        spread = f", from {time[0]:g} to {time[-1]:g} s" if len(time) else ""
        raise MeasurementError(
            f"{path}: has {len(time)} samples after the time 0{spread}; at least {_LEAST} are needed, the last one at"
            f" {10.0**_DECADES:g} times the time of the first"
        )
    sign = np.sign(value)
    if not (sign == sign[0]).all() or sign[0] == 0.0:
        line = table.lines[int(np.flatnonzero(after)[np.flatnonzero(sign != sign[0])[0] if (sign != sign[0]).any() else 0])]
        raise MeasurementError(
            f"{path}, line {line}: {column} is zero or changes its sign; give it from that of the unloaded material"
        )
    return MaterialTest(str(path), column, time, value * sign[0], column.split("_")[0] in _CREEP)


def _only(table: CsvTable, found: list[str], what: str, allowed: str) -> str:
    """Return the only one of the columns found. Raises MeasurementError."""
    if len(found) != 1:
        names = ", ".join(found or table.header)
        number = "several columns" if found else "no column"
        raise MeasurementError(f"{table.path}: has {number} with the {what}: {names}; exactly one is needed: {allowed}")
    return found[0]
