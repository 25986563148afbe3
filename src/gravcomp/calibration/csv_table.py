"""A CSV file with a header, read column by column; errors name the file, the line and the column."""

import csv
import dataclasses
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from gravcomp.calibration.measured import MeasurementError

_NO_TEXT = "is not a UTF-8 text file; export the table as CSV (UTF-8, commas)"


@dataclasses.dataclass(frozen=True)
class CsvTable:
    """header: names of the columns; rows: the cells by column; lines: the line of each row in the file."""

    path: Path
    header: tuple[str, ...]
    rows: tuple[dict[str, str], ...]
    lines: tuple[int, ...]

    @staticmethod
    def read(path: Path) -> "CsvTable":
        """Read a file. Raises MeasurementError where it is no CSV file, and for a row with another number of cells."""
        try:
            with path.open(newline="", encoding="utf-8-sig") as file:
                reader = csv.reader(file)
                header = tuple(name.strip() for name in next(reader, []))
                read = [(reader.line_num, cells) for cells in reader if any(cell.strip() for cell in cells)]
        except UnicodeDecodeError as error:
            raise MeasurementError(f"{path}: {_NO_TEXT}") from error
        except (OSError, csv.Error) as error:
            raise MeasurementError(f"{path}: cannot be read as CSV: {error}") from error
        for character, name in ((";", "semicolons"), ("\t", "tabs")):
            if len(header) == 1 and character in header[0]:
                raise MeasurementError(f"{path}: its columns are separated by {name}; commas are needed")
        if not all(name.isprintable() for name in header):
            raise MeasurementError(f"{path}: {_NO_TEXT}")
        for line, cells in read:
            if len(cells) < len(header) or any(cell.strip() for cell in cells[len(header) :]):
                raise MeasurementError(
                    f"{path}, line {line}: has {len(cells)} cells; the header names {len(header)}. Is the line cut off, or does"
                    " it have commas within numbers?"
                )
        rows = tuple({name: cell.strip() for name, cell in zip(header, cells)} for _, cells in read)
        return CsvTable(path, header, rows, tuple(line for line, _ in read))

    def require(self, names: Sequence[str], hint: str = "") -> None:
        """Raise MeasurementError for the first of the columns `names` that is missing, or there twice.

        hint: what is added to the sentence about a missing one.
        """
        missing = [name for name in names if name not in self.header]
        if missing:
            needed = f"; needed: {', '.join(names)}" if len(names) > 1 else ""
            raise MeasurementError(
                f"{self.path}: the column '{missing[0]}' is missing{hint}{needed}; found: {', '.join(self.header)}"
            )

        for name in names:
            if (count := self.header.count(name)) > 1:
                raise MeasurementError(f"{self.path}: the column '{name}' is there {count} times; it must be unique")

    def only(self, which: Sequence[bool]) -> "CsvTable":
        """Return the table of the rows for which `which` holds."""
        kept = [pair for pair, wanted in zip(zip(self.rows, self.lines), which) if wanted]
        return dataclasses.replace(self, rows=tuple(row for row, _ in kept), lines=tuple(line for _, line in kept))

    def texts(self, name: str) -> list[str]:
        """Return the cells of a column. Raises MeasurementError if it is missing."""
        self.require([name])
        return [row[name] for row in self.rows]

    def numbers(self, name: str, scale: float = 1.0, empty: float | None = None) -> np.ndarray:
        """Return a column (k,) times `scale`; empty: the value of an empty cell, None: it must not be empty.

        Raises MeasurementError if the column is missing, and for a cell that is no finite number.
        """
        return np.array([self._number(line, name, text, empty) for line, text in zip(self.lines, self.texts(name))]) * scale

    def vectors(self, names: Sequence[str], scale: float = 1.0, empty: float | None = None) -> np.ndarray:
        """Return several columns side by side (k, n), as `numbers`."""
        return np.column_stack([np.zeros((len(self.rows), 0)), *(self.numbers(name, scale, empty) for name in names)])

    def _number(self, line: int, name: str, text: str, empty: float | None) -> float:
        if not text and empty is not None:
            return empty
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            found = f"is '{text}'" if text else "is empty"
            allowed = "" if empty is None else ", or nothing"
            raise MeasurementError(f"{self.path}, line {line}: {name} {found}; a finite number{allowed} is needed")
        return value
