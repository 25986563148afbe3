"""Output of the commands: the result on stdout; progress, notes and errors on stderr.

With --json the result is exactly one line on stdout, a JSON object. With --quiet nothing but errors is printed on stderr.
"""

import argparse
import contextlib
import io
import json
import os
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any, TextIO

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress

_LINE_PERIOD = 5.0  # s between two lines of progress
_options = argparse.Namespace(json=False, quiet=False)


def configure(*, json: bool, quiet: bool) -> None:
    """Set what --json and --quiet ask for; once per process, before the command runs."""
    _options.json, _options.quiet = json, quiet
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # a terminal for ASCII shows ? for what it does not have


def note(text: str) -> None:
    """Print a note on stderr unless --quiet was given."""
    if not _options.quiet:
        print(text, file=sys.stderr, flush=True)


def console() -> "Console":
    """Return a console for progress, notes and tables in addition to the result: stderr, silent with --quiet."""
    return _console(sys.stderr, quiet=_options.quiet)


def display(*columns: Any) -> "Progress":
    """Return a display of progress on stderr in these columns of rich, by default its own; without a terminal it does nothing.

    It would show nothing there, but make its picture ten times a second, which takes a twentieth of a processor.
    """
    from rich.progress import Progress

    shown = console()
    return Progress(*columns, console=shown, transient=True, disable=not shown.is_terminal)


@contextlib.contextmanager
def busy(what: str) -> Iterator[Callable[[str], None]]:
    """Show on a terminal what is being done; the function changes the text."""
    shown = console()
    if not shown.is_terminal:
        yield lambda text: None
        return
    with shown.status(what) as status:
        yield status.update


@contextlib.contextmanager
def progress(what: str) -> Iterator[Callable[[float], None]]:
    """Show on stderr how far something is, as a bar or in lines where there is no terminal; the function receives the share."""
    shown = display()
    if not shown.disable:
        with shown:
            task = shown.add_task(what, total=1.0)
            yield lambda done: shown.update(task, completed=done)
        return
    last = time.monotonic()

    def line(done: float) -> None:
        nonlocal last
        if time.monotonic() - last >= _LINE_PERIOD:
            last = time.monotonic()
            note(f"{what}: {100 * done:.0f} %")

    yield line


@contextlib.contextmanager
def stages(first: str) -> Iterator[Callable[[str], None]]:
    """Show on stderr the present stage of something, in a line with the time that has passed; the function changes the stage."""
    from rich.progress import SpinnerColumn, TextColumn, TimeElapsedColumn

    with display(SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn()) as shown:
        task = shown.add_task(first)
        yield lambda stage: shown.update(task, description=stage)


def result(figures: Mapping[str, Any], readable: Any) -> None:
    """Print the result of a command.

    Without --json `readable` (text or a rich renderable) is printed on stdout. With --json `figures` is printed there as one
    line, numbers that are not finite as null, and `readable` goes to stderr unless --quiet was given.
    """
    out = console() if _options.json else _console(sys.stdout)
    if isinstance(readable, str):
        # Plain text is neither wrapped nor read as markup.
        out.print(readable, markup=False, soft_wrap=True)
    else:
        out.print(readable)
    if _options.json:
        from gravcomp.report.result import plain

        print(json.dumps(plain(figures), default=str), flush=True)


def _console(stream: TextIO, *, quiet: bool = False) -> "Console":
    from rich.console import Console

    # Rich takes 80 columns where there is no terminal, which would wrap the tables in logs and pipes.
    width = None if stream.isatty() or "COLUMNS" in os.environ else 160
    return Console(file=stream, quiet=quiet, highlight=False, width=width)
