"""Figures as a table: on the terminal, and in a Markdown document, renewed in place by the command that measured them.

A table stands between `<!-- figures COMMAND -->` and `<!-- end -->`, COMMAND as in `./gravcomp COMMAND`.
"""

import datetime
import os
import platform
import re
from collections.abc import Sequence
from pathlib import Path

from gravcomp.config import ConfigError
from gravcomp.report.result import Figure


def rich_table(title: str, figures: Sequence[Figure]):
    """The figures for a terminal, as a rich.table.Table."""
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
    """The figures as Markdown."""
    header, rows = _cells(figures, {True: "reached", False: "**missed**", None: ""})
    return "\n".join(f"| {' | '.join(cells)} |" for cells in (header, ["---"] * len(header), *rows)) + "\n"


def check_place(path: Path, command: str) -> None:
    """Before hours of measuring: raises ConfigError when the document cannot be read or has no place for the command's table."""
    try:
        text = path.read_text()
    except OSError as error:
        raise ConfigError(f"--write is {path}: cannot be read: {error.strerror}") from error
    if not _place(command).search(text):
        raise ConfigError(
            f"--write is {path}: it has no place for the table; needed: '<!-- figures {command} -->' and after it '<!-- end -->'"
        )


def renew(path: Path, command: str, figures: Sequence[Figure]) -> None:
    """Put the figures into the document, with the day and the kind of machine. Raises ConfigError as `check_place`."""
    check_place(path, command)
    where = f"\n`./gravcomp {command}`, {datetime.date.today().isoformat()}, {os.cpu_count()} cores of {_processor()}.\n"
    path.write_text(_place(command).sub(lambda match: match[1] + markdown_table(figures) + where + match[2], path.read_text()))


def _cells(figures: Sequence[Figure], words: dict) -> tuple[list[str], list[list[str]]]:
    """Header and rows; the article's column only where it says something."""
    article = any(figure.article for figure in figures)
    header = ["figure", "here", *(["the article"] if article else []), "to be reached", ""]
    return header, [[f.name, f.text, *([f.article] if article else []), f.target, words[f.reached]] for f in figures]


def _place(command: str) -> re.Pattern:
    return re.compile(rf"(<!-- figures {re.escape(command)} -->\n).*?(<!-- end -->)", re.DOTALL)


def _processor() -> str:
    try:
        found = re.search(r"^model name\s*: (.+)$", Path("/proc/cpuinfo").read_text(), re.MULTILINE)
    except OSError:
        found = None
    return found[1].strip() if found else platform.machine()
