"""Progress on stderr: a bar on a terminal, otherwise a line for each tenth."""

import sys
import time

WIDTH = 28


def note(text: str, end: str = "\n") -> None:
    """Print a note on stderr unless --quiet was given: commands are not yet parsed while the environment is built."""
    if "--quiet" not in sys.argv:
        print(text, end=end, file=sys.stderr, flush=True)


class Progress:
    """One long step: `with Progress("Python packages", total=200) as p: p.advance("numpy")`."""

    def __init__(self, title: str, total: int):
        self.title = title
        self.total = max(total, 1)
        self.done = 0
        self._started = time.monotonic()
        self._printed_tenth = -1
        self._tty = sys.stderr.isatty()
        self._notes: "list[str]" = []

    def __enter__(self) -> "Progress":
        self._show("")
        return self

    def __exit__(self, kind: "type | None", *_: object) -> None:
        seconds = time.monotonic() - self._started
        end = "done" if kind is None else "not finished"
        notes = "".join(f" ({note})" for note in self._notes)
        line = f"{self.title}: {end} after {seconds:.0f} s{notes}"
        note(f"{chr(13) if self._tty else ''}{line}".ljust(79))

    def advance(self, what: str, steps: int = 1) -> None:
        """Count completed steps; `what` names the latest."""
        self.done = min(self.done + steps, self.total)
        self._show(what)

    def note(self, text: str) -> None:
        """Add a remark to the line that is printed at the end."""
        self._notes.append(text)

    def _show(self, what: str) -> None:
        share = self.done / self.total
        if self._tty:
            bar = "#" * int(share * WIDTH)
            note(f"\r{self.title} [{bar:<{WIDTH}}] {what[:28]:<28}", end="")
        elif int(share * 10) > self._printed_tenth:
            self._printed_tenth = int(share * 10)
            note(f"{self.title}: {share:4.0%} {what}")
