"""The text of a CSV file as a table: separator, decimal commas and header are found from the text.

A header may have two lines, the first with names of groups (RepoIMU), and may begin with #. A field is quoted or not.
"""

import codecs
import csv
import io
import re
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from gravcomp.recordings.imu.csv_units import is_unit
from gravcomp.recordings.imu.recording import RecordingError

_DECIMAL_COMMA = re.compile(r"^[+-]?\d*,\d+([eE][+-]?\d+)?$")
_LONGEST_HEADER = 100  # lines before the first line of numbers
_SEPARATORS = (";", "\t", "|", ",")
_COMMENT = "#%"  # characters with which a line of the header may begin


@dataclass(frozen=True)
class Table:
    """`names` of the columns (without a header: empty texts), and their fields as texts, row by row."""

    source: str
    names: tuple[str, ...]
    rows: list[list[str]]

    def numbers(self, column: int) -> np.ndarray:
        """Return a column (n,) as numbers, NaN where it is none."""
        return np.array([_number(row[column]) for row in self.rows])

    def clock_times(self, column: int) -> np.ndarray | None:
        """Return a column of dates or times of day in ISO 8601 in ns (n,), None where it is none. Raises RecordingError."""
        times: list[int] = []
        for i, row in enumerate(self.rows):
            try:
                if ":" not in row[column]:
                    raise ValueError
                times.append(_clock(row[column]))
            except ValueError:
                if not times:
                    return None
                text = f"{self.source}: column '{self.names[column]}' is no time of a clock in row {i + 1}: '{row[column]}'"
                raise RecordingError(text) from None
        return np.array(times, np.int64)

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
    lines = [line for line in _decoded(data).splitlines() if line.strip()]
    if not lines:
        raise RecordingError(f"{path}: is empty; a header and lines of numbers are needed")
    separator = _separator(lines)
    fields = _split(lines[:_LONGEST_HEADER], separator)
    begin = next((i for i, row in enumerate(fields) if _is_data(row)), None)
    if begin is None:
        raise RecordingError(f"{path}: has no line of numbers among the first {min(len(lines), _LONGEST_HEADER)}")
    names = _names(fields[max(0, begin - 3) : begin], len(fields[begin]))
    rows = _split(lines[begin : None if longest is None else begin + longest], separator)
    if names and len(rows[0]) == len(names) + 1 and not rows[0][-1]:  # a separator ends each line of numbers
        rows = [row[:-1] if row and not row[-1] else row for row in rows]
    width = len(rows[0])
    if separator == "," and names and any(names) and width > len(names):
        raise RecordingError(
            f"{path}: has {width} fields under {len(names)} names: commas are separators and decimal points at once;"
            " export it with semicolons or tabulators as separators, or with decimal points"
        )
    if names and len(names) != width:
        raise RecordingError(
            f"{path}: its header names {len(names)} columns, and the lines of numbers have {width} fields:"
            f" {', '.join(name or '-' for name in names)}"
        )
    if any(_DECIMAL_COMMA.match(field) for row in rows[:5] for field in row):
        rows = [[field.replace(",", ".") for field in row] for row in rows]
    if len(rows[-1]) < width:  # cut off while it was written
        rows.pop()
    odd = next((i for i, row in enumerate(rows) if len(row) != width), None)
    if odd is not None:
        raise RecordingError(f"{path}: row {odd + 1} of the numbers has {len(rows[odd])} fields; the first has {width}")
    return Table(str(path), names or ("",) * width, rows)


def _decoded(data: bytes) -> str:
    """Return the text of a file in UTF-8, UTF-16 with a mark of the byte order (spreadsheets), or Latin-1."""
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return data.decode("utf-16", errors="replace")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def _separator(lines: list[str]) -> str:
    for line in reversed(lines[:_LONGEST_HEADER]):  # a line of numbers
        for separator in _SEPARATORS:
            if separator in line and not (separator == "," and _all_numbers(line.split())):
                return separator
    return " "


def _all_numbers(words: list[str]) -> bool:
    """Whether words are the numbers of a line, with decimal commas."""
    return len(words) > 3 and all(_DECIMAL_COMMA.match(word) or word.lstrip("+-").isdigit() for word in words)


def _split(lines: list[str], separator: str) -> list[list[str]]:
    if separator == " ":
        return [line.lstrip(_COMMENT).replace('"', "").split() for line in lines]
    try:
        rows = list(csv.reader(io.StringIO("\n".join(lines)), delimiter=separator, skipinitialspace=True))
    except csv.Error:  # quotes that are not closed
        rows = [line.replace('"', "").split(separator) for line in lines]
    return [[field.strip().strip("'") for field in row] for row in rows]


def _is_data(row: list[str]) -> bool:
    filled = [field for field in row if field]
    numbers = [field for field in filled if np.isfinite(_number(field.replace(",", ".")))]
    return len(filled) > 0 and len(numbers) > 0.5 * len(filled) and row[0][:1] not in tuple(_COMMENT)


def _names(header: list[list[str]], width: int) -> tuple[str, ...]:
    """Return the names of the columns from the last lines before the numbers: of groups, of columns, of units."""
    if not header:
        return ()
    lines = [[name.lstrip(_COMMENT).strip() for name in line] for line in header]
    units: list[str] = []
    filled = [name for name in lines[-1] if name]
    if len(lines) > 1 and filled and sum(map(is_unit, filled)) > 0.5 * len(filled):
        units = lines.pop()
    last, above = lines[-1], lines[-2] if len(lines) > 1 else []
    if len(above) >= len(last) > 1 and not any(_names_axis(name) for name in above) and any(above[1:]):
        group = ""
        joined = []
        for outer, name in zip(above, last):
            group = outer or group
            joined.append(f"{group} {name}".strip() if outer or name else "")
        last = joined
    last = [
        f"{name} ({unit.strip('()[]{}')})" if is_unit(unit) else name for name, unit in zip(last, [*units, *[""] * len(last)])
    ]
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


def _clock(text: str) -> int:
    """Return a date or a time of day in ns. Raises ValueError."""
    whole, _, part = text.replace(",", ".").partition(".")
    digits = re.match(r"\d*", part)
    fraction = digits.group() if digits else ""
    zone = part[len(fraction) :].strip()
    moment = datetime.fromisoformat(whole.strip() + zone if "-" in whole else f"1970-01-02 {whole.strip()}{zone}")
    if moment.tzinfo is None:
        moment = moment.replace(tzinfo=UTC)
    return round(moment.timestamp()) * 10**9 + int(fraction.ljust(9, "0")[:9] or 0)
