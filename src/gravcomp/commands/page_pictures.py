"""The pictures that `demo --screenshots` takes of the live page once the play is over: the page is turned back to each moment.

So the browser, which takes a processor for itself where there is no graphics card, neither disturbs the play nor is too late for it.
"""

from pathlib import Path

from gravcomp.commands import output
from gravcomp.config import ConfigError
from gravcomp.view.browser import Browser, BrowserError, find_chromium


class PagePictures:
    """`moments`: when (s into the play) to take the picture of which name. Raises ConfigError when there is no browser or no folder."""

    def __init__(self, folder: Path, moments: dict[str, float]):
        self._folder, self._due = folder, dict(moments)
        self._times: dict[str, float] = {}
        if find_chromium() is None:
            raise ConfigError("--screenshots: no Chromium on this machine: apt-get install chromium")
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ConfigError(f"--screenshots {folder}: cannot be made: {error.strerror}") from error

    def follow(self, elapsed: float, now: float) -> None:
        """Note when a moment has come: `elapsed` (s) into the play at the time `now` (s, monotonic)."""
        for name, moment in self._due.items():
            if name not in self._times and elapsed >= moment:
                self._times[name] = now

    def take(self, address: str) -> str:
        """Write NAME.png of each moment that has come; returns why not all could be, or nothing."""
        try:
            with Browser() as browser:
                browser.open(f"{address}?fixedDpr=1")  # sharp, however slowly it is drawn
                for name, time in self._times.items():
                    browser.look_back(time)
                    path = self._folder / f"{name}.png"
                    browser.save(path)
                    output.note(f"Picture of the page: {path}")
        except (BrowserError, OSError) as error:
            return f"--screenshots: {error}"
        return ""
