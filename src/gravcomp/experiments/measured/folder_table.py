"""The table of a folder of measurements: under the name of its README, or the folder's only one."""

from pathlib import Path

from gravcomp.calibration.csv_table import CsvTable
from gravcomp.calibration.measured import MeasurementError


def folder_table(folder: Path, name: str) -> CsvTable:
    """Read the table `name` of a folder; where there is none of this name, the folder's only CSV file.

    Raises MeasurementError where there are none or several, and for a table without rows.
    """
    path = folder / name
    if not path.is_file():
        others = sorted(folder.glob("*.csv"))
        if len(others) != 1:
            found = ", ".join(other.name for other in others) or "no CSV file"
            raise MeasurementError(f"{path} does not exist; needed: {name}, or one other CSV file; found: {found}")
        path = others[0]
    table = CsvTable.read(path)
    if not table.rows:
        raise MeasurementError(f"{path}: contains no rows below its header")
    return table
