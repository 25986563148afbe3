"""The text of a CSV file as a table: separator, decimal commas and header are found from the text.

A header may have two lines, the first with names of groups (RepoIMU), and may begin with #. A field is quoted or not.
"""

import csv
import io
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gravcomp.recordings.imu.recording import RecordingError

_DECIMAL_COMMA = re.compile(r"^[+-]?\d*,\d+([eE][+-]?\d+)?$")
_LONGEST_HEADER = 20  # lines before the first line of numbers


@dataclass(frozen=True)
class Table:
    """`names` of the columns (without a header: empty texts), and their fields as texts, row by row."""

    source: str
    names: tuple[str, ...]
    rows: list[list[str]]

    def numbers(self, column: int) -> np.ndarray:
        """Return a column (n,) as numbers, NaN where it is none."""
        return np.array([_number(row[column]) for row in self.rows])

    def whole_numbers(self, column: int) -> list[int] | None:
        """Return a column as integers, None where one is none: times in ns have more digits than a float."""
        try:
            return [int(row[column]) for row in self.rows]
        except ValueError:
            return None


def read_table(path: Path, *, longest: int | None = None) -> Table:
    """Return the table in a file, of its first `longest` rows. Raises RecordingError."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror or error}") from error
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    lines = [line for line in text.splitlines() if line.strip()]
    separator = _separator(lines)
    fields = _split(lines[:_LONGEST_HEADER], separator)
    begin = next((i for i, row in enumerate(fields) if _is_data(row)), None)
    if begin is None:
        raise RecordingError(f"{path}: has no line of numbers among the first {_LONGEST_HEADER}")
    names = _names(fields[max(0, begin - 2) : begin], len(fields[begin]))
    rows = _split(lines[begin : None if longest is None else begin + longest], separator)
    width = len(rows[0])
    if separator == "," and names and any(names) and width > len(names):
        raise RecordingError(
            f"{path}: has {width} fields under {len(names)} names: commas are separators and decimal points at once;"
            " export it with semicolons or tabulators as separators, or with decimal points"
        )
    if any(_DECIMAL_COMMA.match(field) for row in rows[:5] for field in row):
        rows = [[field.replace(",", ".") for field in row] for row in rows]
    if len(rows[-1]) < width:  # cut off while it was written
        rows.pop()
    odd = next((i for i, row in enumerate(rows) if len(row) != width), None)
    if odd is not None:
        raise RecordingError(f"{path}: row {odd + 1} of the numbers has {len(rows[odd])} fields; the first has {width}")
    return Table(str(path), names or ("",) * width, rows)


def _separator(lines: list[str]) -> str:
    for line in reversed(lines[:_LONGEST_HEADER]):  # a line of numbers
        for separator in (";", "\t", ","):
            if separator in line:
                return separator
    return " "


def _split(lines: list[str], separator: str) -> list[list[str]]:
    if separator == " ":
        return [line.lstrip("#").split() for line in lines]
    rows = csv.reader(io.StringIO("\n".join(lines)), delimiter=separator)
    return [[field.strip() for field in row] for row in rows]


def _is_data(row: list[str]) -> bool:
    filled = [field for field in row if field]
    numbers = [field for field in filled if np.isfinite(_number(field.replace(",", ".")))]
    return len(filled) > 0 and len(numbers) > 0.5 * len(filled) and not row[0].startswith("#")


def _names(header: list[list[str]], width: int) -> tuple[str, ...]:
    """Return the names of the columns from the last lines before the numbers."""
    if not header:
        return ()
    last = [name.lstrip("#").strip() for name in header[-1]]
    if len(header) == 2 and not any(_names_axis(name) for name in header[0]) and len(header[0]) >= len(last):
        group = ""
        joined = []
        for above, name in zip(header[0], last):
            group = above.lstrip("#").strip() or group
            joined.append(f"{group} {name}".strip())
        last = joined
    while len(last) > width and not last[-1]:
        last.pop()
    return tuple(last)


def _names_axis(name: str) -> bool:
    return bool(re.search(r"(^|[\s_.])[xyz]\b", name.lower()))


def _number(field: str) -> float:
    try:
        return float(field)
    except ValueError:
        return float("nan")
