"""Reading of an SQLite bag without its end: all messages before the first page that is missing or damaged.

An SQLite file is a sequence of pages (https://sqlite.org/fileformat2.html). SQLite refuses a file that has fewer pages than its
header says. So a copy is filled up with empty pages; its rows can then be read in the order in which they were written, up to the
first that is on a missing page.
"""

import contextlib
import os
import shutil
import sqlite3
from pathlib import Path

_LARGEST_PAGE = 65536


def repaired(file: Path, folder: Path) -> Path:
    """Write what can be read of an SQLite file into a complete one in `folder`, and return its path.

    Raises sqlite3.Error where not even the list of its tables can be read.
    """
    padded, whole = folder / "padded.db3", folder / file.name
    shutil.copyfile(file, padded)
    with padded.open("rb") as head:
        header = head.read(32)
    page = int.from_bytes(header[16:18], "big")
    page = _LARGEST_PAGE if page == 1 else max(page, 1)
    present = padded.stat().st_size // page
    os.truncate(padded, present * page)  # of a page that is cut, nothing is used
    os.truncate(padded, max(present, int.from_bytes(header[28:32], "big")) * page)
    with (
        contextlib.closing(sqlite3.connect(f"file:{padded}?immutable=1", uri=True)) as source,
        contextlib.closing(sqlite3.connect(whole)) as target,
    ):
        tables = source.execute(
            "SELECT name, sql FROM sqlite_master WHERE type = 'table' AND name NOT LIKE 'sqlite_%'"
        ).fetchall()
        for name, statement in tables:
            target.execute(statement)
            with contextlib.suppress(sqlite3.DatabaseError):  # the end of the readable part
                rows = source.execute(f'SELECT * FROM "{name}"')
                marks = ", ".join("?" * len(rows.description))
                for row in rows:
                    target.execute(f'INSERT INTO "{name}" VALUES ({marks})', row)
        target.commit()
    padded.unlink()
    return whole
