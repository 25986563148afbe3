"""Figures as a table: on the terminal, and in a Markdown document, where the command that measures them updates it in place.

The table is between the markers `<!-- figures COMMAND -->` and `<!-- end -->`, COMMAND as in `./gravcomp COMMAND`.
"""

import datetime
import os
import platform
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from gravcomp.config import ConfigError
from gravcomp.report.result import Figure

if TYPE_CHECKING:
    from rich.table import Table as RichTable


def rich_table(title: str, figures: Sequence[Figure]) -> "RichTable":
    """Return the figures as a table for the terminal."""
    from rich.table import Table

    words = {True: "[green]reached[/green]", False: "[red]missed[/red]", None: ""}
    header, rows = _cells(figures, words)
    table = Table(title=title, title_justify="left", box=None, pad_edge=False, title_style="bold")
    for name in header:
        table.add_column(name)
    for row in rows:
        table.add_row(*row)
    return table


def markdown_table(figures: Sequence[Figure]) -> str:
    """Return the figures as a Markdown table."""
    header, rows = _cells(figures, {True: "reached", False: "**missed**", None: ""})
    return "\n".join(f"| {' | '.join(cells)} |" for cells in (header, ["---"] * len(header), *rows)) + "\n"


def check_place(path: Path, command: str) -> None:
    """Raise ConfigError when the document cannot be read or has no markers for the table; called before measuring."""
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"--write is {path}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise ConfigError(f"--write is {path}: is not a UTF-8 text file; a Markdown document is needed") from error
    if not _place(command).search(text):
        raise ConfigError(
            f"--write is {path}: no markers for the table; needed: '<!-- figures {command} -->' and after it '<!-- end -->'"
        )


def renew(path: Path, command: str, figures: Sequence[Figure], typed: str = "") -> None:
    """Write the figures into the document, with the date and the processor; typed: the command with its arguments.

    Raises ConfigError as `check_place`.
    """
    check_place(path, command)
    where = f"\n`./gravcomp {typed or command}`, {datetime.date.today().isoformat()}, {os.cpu_count()} cores of {_processor()}.\n"
    text = path.read_text(encoding="utf-8")
    table = markdown_table(figures) + where
    path.write_text(_place(command).sub(lambda match: match[1] + table + match[2], text), encoding="utf-8")


def _cells(figures: Sequence[Figure], words: dict) -> tuple[list[str], list[list[str]]]:
    """Return header and rows; the article's column is left out when it is empty."""
    article = any(figure.article for figure in figures)
    header = ["figure", "measured", *(["article"] if article else []), "limit", ""]
    return header, [[f.name, f.text, *([f.article] if article else []), f.target, words[f.reached]] for f in figures]


def _place(command: str) -> re.Pattern:
    return re.compile(rf"(<!-- figures {re.escape(command)} -->\n).*?(<!-- end -->)", re.DOTALL)


def _processor() -> str:
    try:
        found = re.search(r"^model name\s*: (.+)$", Path("/proc/cpuinfo").read_text(encoding="utf-8"), re.MULTILINE)
    except OSError:
        found = None
    return found[1].strip() if found else platform.machine()
