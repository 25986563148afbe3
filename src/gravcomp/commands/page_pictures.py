"""The pictures that `demo --screenshots` takes of the live page: once while the robot sags, once while it is compensated."""

import sys
from pathlib import Path

from gravcomp.config import ConfigError
from gravcomp.view.browser import Browser, BrowserError


class PagePictures:
    """Looks at the page; `take` writes sagging.png and compensated.png into `folder` when their times (s) have come.

    Raises ConfigError when the folder cannot be made or there is no browser.
    """

    def __init__(self, address: str, folder: Path, sagging_until: float, compensated_until: float):
        # Late in each phase, when the robot has come to rest; a picture takes a second or two.
        self._due = [(0.6 * sagging_until, folder / "sagging.png"), (sagging_until + 0.7 * (compensated_until - sagging_until), folder / "compensated.png")]
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._browser = Browser(address)
        except (OSError, BrowserError) as error:
            raise ConfigError(f"--screenshots {folder}: {error}") from error

    def __enter__(self) -> "PagePictures":
        return self

    def __exit__(self, *details) -> None:
        self._browser.__exit__(*details)

    def take(self, elapsed: float) -> None:
        """Write each picture whose time has come, `elapsed` (s) after the run's begin."""
        while self._due and elapsed >= self._due[0][0]:
            _, path = self._due.pop(0)
            self._browser.save(path)
            print(f"Picture of the page: {path}", file=sys.stderr, flush=True)
