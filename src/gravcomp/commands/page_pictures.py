"""Pictures of the live page for `demo --screenshots`, taken after the run: the page is turned back to each moment.

Without a graphics card a browser uses a whole processor. After the run it neither disturbs the loop nor misses a moment.
"""

from pathlib import Path

from gravcomp.commands import output
from gravcomp.commands.folders import made_folder
from gravcomp.config import ConfigError
from gravcomp.view.browser import Browser, BrowserError, find_chromium


class PagePictures:
    """Takes pictures of given moments of the run.

    folder: for the pictures; moments: time in the run (s) by name. Raises ConfigError when there is no browser and when the
    folder cannot be created.
    """

    def __init__(self, folder: Path, moments: dict[str, float]):
        self._folder, self._due = folder, dict(moments)
        self._times: dict[str, float] = {}
        if find_chromium() is None:
            raise ConfigError("--screenshots: no Chromium on this machine: apt-get install chromium")
        made_folder("--screenshots", folder)

    def follow(self, elapsed: float, now: float) -> None:
        """Record the moments that are reached: `elapsed` s of the run at the time `now` (s, monotonic)."""
        for name, moment in self._due.items():
            if name not in self._times and elapsed >= moment:
                self._times[name] = now - (elapsed - moment)

    def take(self, address: str) -> str:
        """Write NAME.png for each recorded moment. Returns the error as text, or ''."""
        try:
            with Browser() as browser:
                browser.open(f"{address}?fixedDpr=1")  # full resolution, even when drawing is slow
                for name, time in self._times.items():
                    browser.look_back(time)
                    path = self._folder / f"{name}.png"
                    browser.save(path)
                    output.note(f"Picture of the page: {path}")
        except (BrowserError, OSError) as error:
            return f"--screenshots: {error}"
        return ""
