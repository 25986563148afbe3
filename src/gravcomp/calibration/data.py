"""What a calibration has to work with: windows at rest, the course that they are from, the weighed mass."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gravcomp.calibration.files import read_measured
from gravcomp.calibration.measured import Measured, StillWindows, still_windows
from gravcomp.calibration.plan import creep_times
from gravcomp.calibration.plan_table import is_plan_table, read_plan_table
from gravcomp.calibration.plausible import check_time, check_units
from gravcomp.calibration.standstill import Standstill
from gravcomp.description import Robot

WINDOWS = 3
"""Windows of each rest: what has crept between them is distinguished from what bends at once."""

_CREEPING = 10  # rests in a course, from which on it shows creep


@dataclass(frozen=True)
class Data:
    """What was measured.

    source: file or 'virtual robot'; windows at rest; measured: the course, None for a table of poses; mass in kg, None:
    unknown; creep_times: of branches that the windows can show, in s; duration: robot time in s, None: unknown.
    """

    source: str
    windows: StillWindows
    measured: Measured | None
    mass: float | None
    creep_times: tuple[float, ...]
    duration: float | None

    @staticmethod
    def of(
        measured: Measured,
        still: Standstill,
        mass: float | None,
        times: tuple[float, ...] | None = None,
        duration: float | None = None,
    ) -> "Data":
        """Return the data of a course; times: of the branches of creep, None: from its rests. Raises MeasurementError."""
        windows = still_windows(measured, still, WINDOWS)
        return Data(measured.source, windows, measured, mass, _times(windows) if times is None else times, duration)


def read_data(path: str | Path, robot: Robot, still: Standstill, mass: float | None, tip_topic: str | None = None) -> Data:
    """Return the data in a CSV file, a filled table of a plan, or a bag. Raises MeasurementError, for other units as well."""
    path = Path(path).expanduser()
    if path.is_file() and is_plan_table(path):
        windows = read_plan_table(path, robot.cable_names)
        check_units(robot, windows, str(path))
        return Data(str(path), windows, None, mass, (), None)
    measured = read_measured(path, robot.cable_names, tip_topic)
    check_time(measured, still)
    check_units(robot, measured, measured.source)
    return Data.of(measured, still, mass)


def _times(windows: StillWindows) -> tuple[float, ...]:
    """Return the times of branches that the rests of one long course show; none where there are only a few, or short ones."""
    history = windows.history
    if history is None or len(np.unique(history.began)) < _CREEPING:
        return ()
    return creep_times(float(np.median(np.diff(np.unique(history.began)))))
